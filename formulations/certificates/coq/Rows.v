(** What drones use at a step, and rows: at most, or at least, so many of them do. *)
From Coq Require Import ZArith List Bool Lia.
From CocapCheck Require Import Spec Sums.
Import ListNotations.
Open Scope Z_scope.

Inductive resource :=
| At (t : nat) (places : list (nat * positive))                   (* class, place *)
| Visit (t : nat) (states : list (nat * state))                   (* class, state *)
| Moving (t : nat) (ways : list (nat * positive * positive)).     (* class, from place to place *)

Definition step_of (r : resource) : nat :=
  match r with At t _ => t | Visit t _ => t | Moving t _ => t end.

(** sign * uses <= sign * count, at a multiplier >= 0 in 1/precision. *)
Record row := Row { used : resource; at_most : bool; count : Z; multiplier : Z }.

Definition sign (r : row) : Z := if at_most r then 1 else -1.

Section Rows.
Variable I : instance.

Definition is_at (k : nat) (p : positive) (x : nat * positive) : bool :=
  Nat.eqb k (fst x) && Pos.eqb p (snd x).

Definition uses_here (r : resource) (k : nat) (s : state) : bool :=
  match r with
  | At _ places => let p := place I k s in existsb (is_at k p) places
  | Visit _ states => existsb (is_at k s) states
  | Moving _ _ => false
  end.

Definition from_here (k : nat) (s : state) (r : resource) : bool :=
  match r with
  | Moving _ ways => let p := place I k s in existsb (fun w => is_at k p (fst w)) ways
  | _ => false
  end.

Definition uses_moving (r : resource) (k : nat) (s s' : state) : bool :=
  match r with
  | Moving _ ways => let p := place I k s in let q := place I k s' in
      existsb (fun w => is_at k p (fst w) && Pos.eqb q (snd w)) ways
  | _ => false
  end.

Definition b2z (b : bool) : Z := if b then 1 else 0.

Definition path_uses (r : resource) (f : flight) : Z :=
  total (S (horizon I)) (fun t => if Nat.eqb (step_of r) t then b2z (uses_here r (fst f) (snd f t)) else 0)
  + total (horizon I) (fun t => if Nat.eqb (step_of r) t
                                then b2z (uses_moving r (fst f) (snd f t) (snd f (S t))) else 0).

Definition plan_uses (r : resource) (plan : list flight) : Z := sumZ (map (path_uses r) plan).

Definition holds (plan : list flight) (r : row) : Prop :=
  sign r * plan_uses (used r) plan <= sign r * count r.

(** * Charges *)

Variable rows : list row.

Definition at_step_ (t : nat) (r : row) : bool := Nat.eqb (step_of (used r)) t.

(** What rows charge a drone for being somewhere at a step, and for a move from there. *)
Definition charge_here (k t : nat) (s : state) : Z :=
  sumZ (map (fun r => if uses_here (used r) k s then sign r * multiplier r else 0)
            (filter (at_step_ t) rows)).

Definition charge_moving (k t : nat) (s : state) : state -> Z :=
  let here := filter (fun r => at_step_ t r && from_here k s (used r)) rows in
  fun s' => sumZ (map (fun r => if uses_moving (used r) k s s' then sign r * multiplier r else 0) here).

Lemma charge_here_all k t s : charge_here k t s
  = sumZ (map (fun r => sign r * multiplier r * (if Nat.eqb (step_of (used r)) t then b2z (uses_here (used r) k s) else 0)) rows).
Proof.
  unfold charge_here. induction rows as [|r l IH]; simpl; [reflexivity|].
  unfold at_step_ at 1. destruct (Nat.eqb (step_of (used r)) t); simpl; rewrite IH; [|lia].
  destruct (uses_here _ _ _); simpl; lia.
Qed.

Lemma from_here_ok k s s' r : uses_moving r k s s' = true -> from_here k s r = true.
Proof.
  destruct r as [| |t ways]; simpl; try discriminate. intros H. apply existsb_exists in H.
  destruct H as [w [Hin H]]. apply andb_true_iff in H. apply existsb_exists. exists w. tauto.
Qed.

Lemma charge_moving_all k t s s' : charge_moving k t s s'
  = sumZ (map (fun r => sign r * multiplier r * (if Nat.eqb (step_of (used r)) t then b2z (uses_moving (used r) k s s') else 0)) rows).
Proof.
  unfold charge_moving. cbv zeta.
  induction rows as [|r l IH]; simpl; [reflexivity|].
  unfold at_step_ at 1. destruct (Nat.eqb (step_of (used r)) t); simpl; [|rewrite IH; lia].
  destruct (from_here k s (used r)) eqn:E; simpl; rewrite IH.
  - destruct (uses_moving _ _ _ _); simpl; lia.
  - destruct (uses_moving (used r) k s s') eqn:Eu; [|simpl; lia].
    rewrite (from_here_ok _ _ _ _ Eu) in E. discriminate.
Qed.

Lemma charges_of_path (f : flight) :
  total (S (horizon I)) (fun t => charge_here (fst f) t (snd f t))
  + total (horizon I) (fun t => charge_moving (fst f) t (snd f t) (snd f (S t)))
  = sumZ (map (fun r => sign r * multiplier r * path_uses (used r) f) rows).
Proof.
  rewrite (total_ext _ _ _ (fun t _ => charge_here_all (fst f) t (snd f t))).
  rewrite (total_ext _ _ _ (fun t _ => charge_moving_all (fst f) t (snd f t) (snd f (S t)))).
  rewrite !total_sum, <- sumZ_add. apply sumZ_ext. intros r _.
  rewrite !total_scale. unfold path_uses. lia.
Qed.

Lemma charges_of_plan plan :
  sumZ (map (fun f => sumZ (map (fun r => sign r * multiplier r * path_uses (used r) f) rows)) plan)
  = sumZ (map (fun r => sign r * multiplier r * plan_uses (used r) plan) rows).
Proof.
  rewrite sumZ_swap. apply sumZ_ext. intros r _. unfold plan_uses. rewrite sumZ_scale. reflexivity.
Qed.

(** * Rows that every plan obeys: any two uses are in conflict *)

Definition exclusive (r : resource) : bool :=
  match r with
  | At _ places => forallb (fun x => forallb (meet I x) places) places
  | Moving _ ways => forallb (fun x => forallb (fun y =>
      clash I x y || meet I (fst x) (fst y)
      || meet I (fst (fst x), snd x) (fst (fst y), snd y)) ways) ways
  | Visit _ _ => false
  end.

Definition row_ok (r : row) : bool := 0 <=? multiplier r.

Definition rule_ok (r : row) : bool :=
  exclusive (used r) && at_most r && (count r =? 1) && row_ok r.

Lemma path_uses_pick r f : path_uses r f =
  (if Nat.ltb (step_of r) (S (horizon I)) then b2z (uses_here r (fst f) (snd f (step_of r))) else 0)
  + (if Nat.ltb (step_of r) (horizon I)
     then b2z (uses_moving r (fst f) (snd f (step_of r)) (snd f (S (step_of r)))) else 0).
Proof.
  unfold path_uses.
  rewrite (total_pick _ _ (fun t => b2z (uses_here r (fst f) (snd f t)))).
  rewrite (total_pick _ _ (fun t => b2z (uses_moving r (fst f) (snd f t) (snd f (S t))))). reflexivity.
Qed.

Lemma uses_01 r f : path_uses r f = 0 \/ path_uses r f = 1.
Proof.
  rewrite path_uses_pick. destruct r; simpl uses_here; simpl uses_moving; unfold b2z;
    repeat match goal with |- context [if ?b then _ else _] => destruct b end; lia.
Qed.

Lemma exclusive_apart r f g : exclusive r = true -> apart I f g ->
  path_uses r f = 0 \/ path_uses r g = 0.
Proof.
  intros He [Hmeet Hclash]. rewrite !path_uses_pick.
  destruct r as [t places | t states | t ways]; simpl step_of; simpl uses_here; simpl uses_moving; [|discriminate|].
  - destruct (Nat.ltb_spec t (S (horizon I))) as [Ht|]; [|left; destruct (Nat.ltb t (horizon I)); reflexivity].
    destruct (existsb _ places) eqn:E1; [|left; destruct (Nat.ltb t (horizon I)); reflexivity].
    destruct (existsb (is_at (fst g) _) places) eqn:E2; [|right; destruct (Nat.ltb t (horizon I)); reflexivity].
    exfalso. apply existsb_exists in E1, E2. destruct E1 as [[k p] [Hx Ex]], E2 as [[k' q] [Hy Ey]].
    unfold is_at in Ex, Ey. simpl in Ex, Ey. split_andb.
    repeat match goal with H : Nat.eqb _ _ = true |- _ => apply Nat.eqb_eq in H
      | H : Pos.eqb _ _ = true |- _ => apply Pos.eqb_eq in H end. subst.
    simpl in He. rewrite forallb_forall in He. specialize (He _ Hx).
    rewrite forallb_forall in He. specialize (He _ Hy). specialize (Hmeet t ltac:(lia)). congruence.
  - destruct (Nat.ltb_spec t (horizon I)) as [Ht|].
    2:{ left. destruct (Nat.ltb t (S (horizon I))); reflexivity. }
    destruct (existsb _ ways) eqn:E1; [|left; destruct (Nat.ltb t (S (horizon I))); reflexivity].
    match goal with |- context [existsb ?f ways] => destruct (existsb f ways) eqn:E2 end;
      [|right; destruct (Nat.ltb t (S (horizon I))); reflexivity].
    exfalso. apply existsb_exists in E1, E2. destruct E1 as [[[k p] p'] [Hx Ex]], E2 as [[[k' q] q'] [Hy Ey]].
    unfold is_at in Ex, Ey. simpl in Ex, Ey. split_andb.
    repeat match goal with H : Nat.eqb _ _ = true |- _ => apply Nat.eqb_eq in H
      | H : Pos.eqb _ _ = true |- _ => apply Pos.eqb_eq in H end. subst.
    simpl in He. rewrite forallb_forall in He. specialize (He _ Hx).
    rewrite forallb_forall in He. specialize (He _ Hy). simpl in He.
    pose proof (Hmeet t ltac:(lia)). pose proof (Hmeet (S t) ltac:(lia)). specialize (Hclash t Ht).
    rewrite Hclash in He. simpl in He. apply orb_true_iff in He. destruct He; congruence.
Qed.

Lemma rule_holds plan r : rule_ok r = true -> ForallOrdPairs (apart I) plan -> holds plan r.
Proof.
  unfold rule_ok. intros H Hp. split_andb. to_Z. unfold holds, sign.
  replace (at_most r) with true by (symmetry; assumption). replace (count r) with 1 by (symmetry; assumption).
  enough (plan_uses (used r) plan <= 1) by lia.
  unfold plan_uses. induction Hp as [|f plan Hf Hp IH]; simpl; [lia|].
  destruct (uses_01 (used r) f) as [E | E]; [lia|].
  rewrite E. enough (sumZ (map (path_uses (used r)) plan) = 0) by lia.
  apply sumZ_zero. intros g Hg. rewrite Forall_forall in Hf.
  destruct (exclusive_apart (used r) f g ltac:(assumption) (Hf g Hg)) as [Z0 | Z0]; [lia | exact Z0].
Qed.
End Rows.
