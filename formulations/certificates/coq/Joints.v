(** Joint states: where all drones are at a step, a number beside each. Drones of one class are
    exchangeable. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Permutation FMapPositive Sorting.Mergesort Orders.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search.
Import ListNotations.
Open Scope Z_scope.

Definition joint : Type := list (nat * state).  (* of each drone, class and state, in no order *)
Definition joints : Type := PM.t (list (joint * Z)).

Fixpoint same_joint (a b : joint) : bool :=
  match a, b with
  | [], [] => true
  | (k, s) :: a', (k', s') :: b' => Nat.eqb k k' && Pos.eqb s s' && same_joint a' b'
  | _, _ => false
  end.

Definition same_drone (a b : nat * state) : bool := Nat.eqb (fst a) (fst b) && Pos.eqb (snd a) (snd b).

Fixpoint take_out (a : nat * state) (j : joint) : option joint :=
  match j with
  | [] => None
  | b :: rest => if same_drone a b then Some rest else option_map (cons b) (take_out a rest)
  end.

(** True if both have the same drones and states, in any order. *)
Fixpoint same_drones (i j : joint) : bool :=
  match i with
  | [] => match j with [] => true | _ => false end
  | a :: rest => match take_out a j with Some j' => same_drones rest j' | None => false end
  end.

(** An order, so that joint states of the same drones and states are the same; nothing more. *)
Module ByState <: TotalLeBool.
  Definition t : Type := nat * state.
  Definition leb (a b : t) : bool := Nat.ltb (fst a) (fst b) || (Nat.eqb (fst a) (fst b) && Pos.leb (snd a) (snd b)).
  Lemma leb_total a b : leb a b = true \/ leb b a = true.
  Proof.
    unfold leb. destruct (Nat.ltb_spec (fst a) (fst b)), (Nat.ltb_spec (fst b) (fst a)); simpl; auto.
    assert (E : fst a = fst b) by lia. rewrite E, Nat.eqb_refl. simpl.
    destruct (Pos.leb_spec (snd a) (snd b)); [auto|]. right. apply Pos.leb_le. lia.
  Qed.
End ByState.
Module Ordered := Sort ByState.

(** Joint states of one key are told apart. *)
Definition key_of (j : joint) : positive := fold_left (fun key ks => (key * 4096 + snd ks)%positive) j xH.

Fixpoint put (j : joint) (v : Z) (l : list (joint * Z)) : list (joint * Z) :=
  match l with
  | [] => [(j, v)]
  | (j', v') :: rest => if same_joint j j' then (j', Z.max v v') :: rest else (j', v') :: put j v rest
  end.

Definition insert (j : joint) (v : Z) (m : joints) : joints :=
  let k := key_of j in PM.add k (put j v (match PM.find k m with Some l => l | None => [] end)) m.

Definition listed (m : joints) : list (joint * Z) := flat_map snd (PM.elements m).

(** The value recorded for a joint state; None if there is none. *)
Definition value_at (j : joint) (m : joints) : option Z :=
  match PM.find (key_of j) m with
  | None => None
  | Some l => largest (fun jv : joint * Z => if same_joint j (fst jv) then Some (snd jv) else None) l None
  end.

Definition recorded (j : joint) (c : R) (m : joints) : Prop :=
  exists l v, PM.find (key_of j) m = Some l /\ In (j, v) l /\ (c <= IZR v)%R.

Lemma same_joint_eq a : forall b, same_joint a b = true -> a = b.
Proof.
  induction a as [|[k s] a IH]; intros [|[k' s'] b] H; simpl in H; try discriminate; [reflexivity|].
  split_andb. match goal with H : Nat.eqb _ _ = true |- _ => apply Nat.eqb_eq in H; subst k' end.
  match goal with H : Pos.eqb _ _ = true |- _ => apply Pos.eqb_eq in H; subst s' end. f_equal. apply IH. assumption.
Qed.

Lemma take_out_ok a j : In a j -> exists j', take_out a j = Some j' /\ Permutation j (a :: j').
Proof.
  induction j as [|b j IH]; intros Hin; [contradiction|]. simpl. unfold same_drone.
  destruct (Nat.eqb_spec (fst a) (fst b)) as [E1 | N1]; [destruct (Pos.eqb_spec (snd a) (snd b)) as [E2 | N2]|]; simpl.
  - exists j. split; [reflexivity|]. destruct a, b. simpl in *. subst. reflexivity.
  - destruct Hin as [-> | Hin]; [contradiction|]. destruct (IH Hin) as [j' [-> Hp]]. exists (b :: j'). split; [reflexivity|].
    eapply Permutation_trans; [apply perm_skip, Hp | apply perm_swap].
  - destruct Hin as [-> | Hin]; [contradiction|]. destruct (IH Hin) as [j' [-> Hp]]. exists (b :: j'). split; [reflexivity|].
    eapply Permutation_trans; [apply perm_skip, Hp | apply perm_swap].
Qed.

Lemma same_drones_ok i : forall j, Permutation i j -> same_drones i j = true.
Proof.
  induction i as [|a i IH]; intros j Hp; simpl.
  - apply Permutation_nil in Hp. subst j. reflexivity.
  - destruct (take_out_ok a j (Permutation_in a Hp (or_introl eq_refl))) as [j' [-> Hj]].
    apply IH. apply (Permutation_cons_inv (a := a)). eapply Permutation_trans; eassumption.
Qed.

Lemma put_new j v l : exists v', In (j, v') (put j v l) /\ v <= v'.
Proof.
  induction l as [|[j' w] l IH]; simpl; [exists v; split; [left; reflexivity | lia]|].
  destruct (same_joint j j') eqn:E.
  - apply same_joint_eq in E. subst j'. exists (Z.max v w). split; [left; reflexivity | lia].
  - destruct IH as [v' [H1 H2]]. exists v'. split; [right; exact H1 | exact H2].
Qed.

Lemma put_old j v l i w : In (i, w) l -> exists w', In (i, w') (put j v l) /\ w <= w'.
Proof.
  induction l as [|[j' u] l IH]; simpl; [intros []|]. intros Hin. destruct (same_joint j j') eqn:E.
  - destruct Hin as [Hin | Hin].
    + injection Hin as -> ->. exists (Z.max v w). split; [left; reflexivity | lia].
    + exists w. split; [right; exact Hin | lia].
  - destruct Hin as [Hin | Hin].
    + injection Hin as -> ->. exists w. split; [left; reflexivity | lia].
    + destruct (IH Hin) as [w' [H1 H2]]. exists w'. split; [right; exact H1 | exact H2].
Qed.

Lemma insert_new j v m c : (c <= IZR v)%R -> recorded j c (insert j v m).
Proof.
  intros Hc. unfold recorded, insert. cbv zeta. rewrite PM.gss.
  match goal with |- context [put j v ?l] => destruct (put_new j v l) as [v' [H1 H2]] end.
  eexists _, v'. split; [reflexivity|]. split; [exact H1|]. apply IZR_le in H2. lra.
Qed.

Lemma insert_old j v m i c : recorded i c m -> recorded i c (insert j v m).
Proof.
  intros [l [w [E [Hin Hc]]]]. unfold recorded, insert. cbv zeta.
  destruct (Pos.eq_dec (key_of i) (key_of j)) as [Ek | Ek].
  - rewrite <- Ek, PM.gss, E. destruct (put_old j v l i w Hin) as [w' [H1 H2]].
    eexists _, w'. split; [reflexivity|]. split; [exact H1|]. apply IZR_le in H2. lra.
  - rewrite PM.gso by exact Ek. exists l, w. auto.
Qed.

Lemma recorded_less j c c' m : (c' <= c)%R -> recorded j c m -> recorded j c' m.
Proof. intros H [l [v [H1 [H2 H3]]]]. exists l, v. repeat split; try assumption. lra. Qed.

Definition recorded_in (j : joint) (c : R) (l : list (joint * Z)) : Prop := exists v, In (j, v) l /\ (c <= IZR v)%R.

Lemma recorded_listed j c m : recorded j c m -> recorded_in j c (listed m).
Proof.
  intros [l [v [E [Hin Hc]]]]. exists v. split; [|exact Hc]. unfold listed. apply in_flat_map.
  exists (key_of j, l). split; [apply PM.elements_correct, E | exact Hin].
Qed.

Lemma same_joint_refl a : same_joint a a = true.
Proof. induction a as [|[k s] a IH]; simpl; [reflexivity|]. rewrite Nat.eqb_refl, Pos.eqb_refl. exact IH. Qed.

Lemma recorded_value j c m : recorded j c m -> exists v, value_at j m = Some v /\ (c <= IZR v)%R.
Proof.
  intros [l [v [E [Hin Hc]]]]. unfold value_at. rewrite E.
  destruct (largest_in (fun jv : joint * Z => if same_joint j (fst jv) then Some (snd jv) else None) l None (j, v) v Hin) as [w [Ew Hw]].
  { cbn [fst snd]. rewrite same_joint_refl. reflexivity. }
  exists w. split; [exact Ew|]. apply IZR_le in Hw. lra.
Qed.

(** A fold over a list keeps what one of its items records, if no other item removes it. *)
Lemma fold_records {B} (f : joints -> B -> joints) (j : joint) (c : R) (l : list B) b :
  (forall m x, recorded j c m -> recorded j c (f m x)) -> (forall m, recorded j c (f m b)) -> In b l ->
  forall m, recorded j c (fold_left f l m).
Proof.
  intros Hkeep Hnew. assert (Hold : forall l m, recorded j c m -> recorded j c (fold_left f l m)).
  { induction l0 as [|x l0 IH]; intros m H; simpl; [exact H | apply IH, Hkeep, H]. }
  induction l as [|x l IH]; intros Hin m; [contradiction|]. simpl. destruct Hin as [-> | Hin]; [apply Hold, Hnew | apply IH, Hin].
Qed.
