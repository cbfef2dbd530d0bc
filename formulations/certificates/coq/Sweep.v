(** Best paths: one sweep from the first step to the last, and one back. *)
From Coq Require Import ZArith List Bool Lia FMapPositive.
From CocapCheck Require Import Spec Sums.
Import ListNotations.
Open Scope Z_scope.
Module PM := PositiveMap.

Definition larger (a : option Z) (b : Z) : option Z :=
  match a with None => Some b | Some x => Some (Z.max x b) end.

Definition reaches (a : option Z) (b : Z) : Prop := exists x, a = Some x /\ b <= x.

Lemma larger_new a b : reaches (larger a b) b.
Proof. destruct a as [x|]; simpl; [exists (Z.max x b) | exists b]; split; auto; lia. Qed.

Lemma larger_old a b c : reaches a c -> reaches (larger a b) c.
Proof. intros [x [-> H]]. simpl. exists (Z.max x b). split; auto; lia. Qed.

(** The largest of some values, those that are there. *)
Definition largest {A} (f : A -> option Z) (l : list A) (first : option Z) : option Z :=
  fold_left (fun best a => match f a with Some v => larger best v | None => best end) l first.

Lemma largest_old {A} (f : A -> option Z) l : forall first c, reaches first c -> reaches (largest f l first) c.
Proof.
  induction l as [|a l IH]; intros first c H; simpl; [exact H|]. apply IH.
  destruct (f a); [apply larger_old|]; exact H.
Qed.

Lemma largest_in {A} (f : A -> option Z) l : forall first a v,
  In a l -> f a = Some v -> reaches (largest f l first) v.
Proof.
  induction l as [|b l IH]; intros first a v Hin Hv; [contradiction|]. destruct Hin as [-> | Hin].
  - simpl. rewrite Hv. apply largest_old, larger_new.
  - simpl. apply (IH _ a v Hin Hv).
Qed.

(** Lifts a state's value to v. *)
Definition lift (s : state) (v : Z) (m : PM.t Z) : PM.t Z :=
  match PM.find s m with
  | Some w => if w <? v then PM.add s v m else m
  | None => PM.add s v m
  end.

Lemma lift_new s v m : reaches (PM.find s (lift s v m)) v.
Proof.
  unfold lift. destruct (PM.find s m) as [w|] eqn:E.
  - destruct (Z.ltb_spec w v).
    + rewrite PM.gss. exists v. split; auto; lia.
    + rewrite E. exists w. split; auto; lia.
  - rewrite PM.gss. exists v. split; auto; lia.
Qed.

Lemma lift_old s v m x c : reaches (PM.find x m) c -> reaches (PM.find x (lift s v m)) c.
Proof.
  intros H. unfold lift. destruct (Pos.eq_dec x s) as [-> | Hne].
  - destruct H as [w [E Hc]]. rewrite E. destruct (Z.ltb_spec w v).
    + rewrite PM.gss. exists v. split; auto; lia.
    + exists w. auto.
  - destruct (PM.find s m) as [w|]; [destruct (w <? v)|]; rewrite ?PM.gso by exact Hne; exact H.
Qed.

Section Sweep.
Variables (T : nat) (moves : nat -> state -> list state).
Variable alive : nat -> state -> bool.          (* step, state *)
Variable price : nat -> state -> Z.             (* step, state *)
Variable toll : nat -> state -> state -> Z.     (* step, move *)

Definition spread_one (t : nat) (m : PM.t Z) (sv : state * Z) : PM.t Z :=
  let base := snd sv + price t (fst sv) in
  let toll_from := toll t (fst sv) in
  let alive_there := alive (S t) in
  fold_left (fun m s' => if alive_there s' then lift s' (base + toll_from s') m else m)
            (moves t (fst sv)) m.

Definition spread (t : nat) (U : PM.t Z) : PM.t Z :=
  fold_left (spread_one t) (PM.elements U) (PM.empty Z).

(** The most that a path brings before each state, step by step. *)
Fixpoint forward (n t : nat) (U : PM.t Z) : list (PM.t Z) :=
  U :: match n with O => [] | S n' => forward n' (S t) (spread t U) end.

Definition best_from (t : nat) (V : PM.t (option Z)) (s : state) : option Z :=
  let toll_from := toll t s in
  match largest (fun s' => match PM.find s' V with
                           | Some (Some v) => Some (toll_from s' + v)
                           | _ => None end) (moves t s) None with
  | None => None
  | Some b => Some (price t s + b)
  end.

(** The most that a path brings from each state on; None where none leads to the last step. *)
Fixpoint backward (t : nat) (Us : list (PM.t Z)) : list (PM.t (option Z)) :=
  match Us with
  | [] => []
  | U :: rest => match backward (S t) rest with
                 | [] => [PM.mapi (fun s _ => Some (price t s)) U]
                 | (V :: _) as Vs => PM.mapi (fun s _ => best_from t V s) U :: Vs
                 end
  end.

Variable p : nat -> state.
Hypothesis p_alive : forall t, (t <= T)%nat -> alive t (p t) = true.
Hypothesis p_moves : forall t, (t < T)%nat -> In (p (S t)) (moves t (p t)).

Definition so_far (t : nat) : Z := total t (fun j => price j (p j) + toll j (p j) (p (S j))).

Fixpoint to_go (n t : nat) : Z :=
  match n with
  | O => price t (p t)
  | S n' => price t (p t) + (toll t (p t) (p (S t)) + to_go n' (S t))
  end.

Definition value : Z :=
  total (S T) (fun t => price t (p t)) + total T (fun t => toll t (p t) (p (S t))).

Lemma value_split : forall n t, (t + n = T)%nat -> so_far t + to_go n t = value.
Proof.
  induction n as [|n IH]; intros t Ht; simpl.
  - unfold value, so_far. assert (t = T) by lia. subst t. simpl. rewrite total_add. lia.
  - rewrite <- (IH (S t)) by lia. unfold so_far. simpl. lia.
Qed.

Lemma spread_one_old t m sv x c : reaches (PM.find x m) c -> reaches (PM.find x (spread_one t m sv)) c.
Proof.
  intros H. unfold spread_one. cbv zeta. revert m H. induction (moves t (fst sv)) as [|s l IH]; intros m H; simpl; [exact H|].
  apply IH. destruct (alive (S t) s); [apply lift_old|]; exact H.
Qed.

Lemma spread_one_new t m s u s' : In s' (moves t s) -> alive (S t) s' = true ->
  reaches (PM.find s' (spread_one t m (s, u))) (u + price t s + toll t s s').
Proof.
  intros Hin Ha. unfold spread_one. cbv zeta. cbn [fst snd].
  assert (Hold : forall l m c, reaches (PM.find s' m) c -> reaches (PM.find s' (fold_left
     (fun m s' => if alive (S t) s' then lift s' (u + price t s + toll t s s') m else m) l m)) c).
  { induction l as [|x l IH]; intros m0 c H; simpl; [exact H|]. apply IH.
    destruct (alive (S t) x); [apply lift_old|]; exact H. }
  revert m. induction (moves t s) as [|x l IH]; intros m; [contradiction|].
  simpl in Hin. destruct Hin as [-> | Hin].
  - simpl. apply Hold. rewrite Ha. apply lift_new.
  - simpl. apply (IH Hin).
Qed.

Lemma spread_ok t U s u s' : PM.find s U = Some u -> In s' (moves t s) -> alive (S t) s' = true ->
  reaches (PM.find s' (spread t U)) (u + price t s + toll t s s').
Proof.
  intros Hs Hin Ha. apply PM.elements_correct in Hs. unfold spread.
  assert (Hold : forall l m c, reaches (PM.find s' m) c -> reaches (PM.find s' (fold_left (spread_one t) l m)) c).
  { induction l as [|x l IH]; intros m0 c H; simpl; [exact H|]. apply IH, spread_one_old, H. }
  generalize (PM.empty Z). revert Hs. induction (PM.elements U) as [|x l IH]; intros Hs m; [contradiction|].
  destruct Hs as [-> | Hs].
  - simpl. apply Hold, spread_one_new; assumption.
  - simpl. apply (IH Hs).
Qed.

(** A path's states are all met on the way. *)
Lemma forward_ok : forall n t U v, (t + n = T)%nat -> reaches (PM.find (p t) U) (v + so_far t) ->
  Forall2 (fun m j => reaches (PM.find (p j) m) (v + so_far j)) (forward n t U) (seq t (S n)).
Proof.
  induction n as [|n IH]; intros t U v Ht H; simpl.
  - constructor; [exact H | constructor].
  - constructor; [exact H|]. apply (IH (S t)); [lia|].
    destruct H as [u [Eu Hu]].
    destruct (spread_ok t U (p t) u (p (S t)) Eu (p_moves t ltac:(lia)) (p_alive (S t) ltac:(lia))) as [w [Ew Hw]].
    exists w. split; [exact Ew|]. unfold so_far in *. simpl. lia.
Qed.

Lemma mapi_find {A B} (f : positive -> A -> B) (m : PM.t A) x :
  PM.find x (PM.mapi f m) = option_map (f x) (PM.find x m).
Proof. apply PM.gmapi. Qed.

Definition comes_to (V : PM.t (option Z)) (s : state) (c : Z) : Prop :=
  exists v, PM.find s V = Some (Some v) /\ c <= v.

Lemma backward_ok : forall n t Us, (t + n = T)%nat ->
  Forall2 (fun m j => exists u, PM.find (p j) m = Some u) Us (seq t (S n)) ->
  Forall2 (fun V j => comes_to V (p j) (to_go (T - j) j)) (backward t Us) (seq t (S n)).
Proof.
  induction n as [|n IH]; intros t Us Ht H.
  - assert (E0 : (T - t = 0)%nat) by lia. clear Ht.
    inversion H as [|U x l l' [u Hu] Hl]; subst. inversion Hl; subst. simpl.
    constructor; [|constructor]. rewrite E0. simpl.
    exists (price t (p t)). rewrite mapi_find, Hu. simpl. split; [reflexivity | lia].
  - change (seq t (S (S n))) with (t :: seq (S t) (S n)) in *.
    destruct Us as [|U l]; [inversion H|]. apply Forall2_head in H. destruct H as [[u Hu] Hl].
    specialize (IH (S t) l ltac:(lia) Hl). cbn [backward].
    destruct (backward (S t) l) as [|V Vs] eqn:E.
    { inversion IH. }
    constructor; [|exact IH].
    change (seq (S t) (S n)) with (S t :: seq (S (S t)) n) in IH.
    apply Forall2_head in IH. destruct IH as [[v [Ev Hv]] _].
    unfold comes_to. rewrite mapi_find, Hu. simpl option_map. unfold best_from. cbv zeta.
    destruct (largest_in (fun s' => match PM.find s' V with Some (Some v) => Some (toll t (p t) s' + v) | _ => None end)
                (moves t (p t)) None (p (S t)) (toll t (p t) (p (S t)) + v) (p_moves t ltac:(lia)))
      as [b [Eb Hb]].
    { rewrite Ev. reflexivity. }
    rewrite Eb. exists (price t (p t) + b). split; [reflexivity|].
    replace (T - t)%nat with (S (T - S t)) by lia. simpl. lia.
Qed.

End Sweep.
