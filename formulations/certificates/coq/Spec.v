(** What is claimed: plans of drones and their reward J.  Whoever believes a bound has to believe
    this page; docs/reference/instances.md says the same in words. *)
From Coq Require Import ZArith List Reals.
Import ListNotations.
Open Scope Z_scope.

Definition state := positive.  (* a place and an orientation *)
Definition group := positive.  (* what is summed before a return: a face at a step, say *)

(** What a group's amounts z are worth together. *)
Inductive return_of := Root | AtMost (k : Z).  (* sqrt z; min(z, k) *)

(** Drones of one class differ in their starts alone.  Classes are numbered, steps are 0..T. *)
Record instance := Instance {
  horizon : nat;                                   (* T *)
  team : list (nat * list state);                  (* of each drone: class, and where it may start *)
  open : nat -> nat -> state -> bool;              (* class, step, state: it may be there then *)
  moves : nat -> nat -> state -> list state;       (* class, step, state: where to from there *)
  bonus : nat -> state -> state -> Z;              (* class, move: its reward, in 1/weight_unit *)
  place : nat -> state -> positive;                (* class, state: where that is *)
  meet : nat * positive -> nat * positive -> bool; (* two drones may not be at these places at once *)
  clash : nat * positive * positive -> nat * positive * positive -> bool;
                                                   (* nor fly from place to place in one step *)
  sees : nat -> nat -> state -> list (group * Z);  (* class, step, state: amounts in 1/amount_unit *)
  n_groups : nat;                                  (* groups are 1..n_groups *)
  weight : group -> Z;                             (* in 1/weight_unit *)
  return_by : group -> return_of;
  amount_unit : Z;
  weight_unit : Z
}.

(** The class of a drone, and its state at each step; what it says beyond step T has no meaning. *)
Definition flight : Type := nat * (nat -> state).

(** f 0 + f 1 + .. + f (n - 1) *)
Fixpoint total (n : nat) (f : nat -> Z) : Z :=
  match n with O => 0 | S n' => total n' f + f n' end.
Fixpoint sumZ (l : list Z) : Z := match l with [] => 0 | x :: l' => x + sumZ l' end.
Fixpoint sumR (l : list R) : R := match l with [] => 0%R | x :: l' => (x + sumR l')%R end.

Section Plans.
Variable I : instance.

(** A drone with these starts can fly so. *)
Definition is_flight (starts : list state) (f : flight) : Prop :=
  let (k, at_) := f in
  In (at_ 0%nat) starts
  /\ (forall t, (t <= horizon I)%nat -> open I k t (at_ t) = true)
  /\ (forall t, (t < horizon I)%nat -> In (at_ (S t)) (moves I k t (at_ t))).

(** Two drones keep the rules. *)
Definition apart (f g : flight) : Prop :=
  let p t := place I (fst f) (snd f t) in
  let q t := place I (fst g) (snd g t) in
  (forall t, (t <= horizon I)%nat -> meet I (fst f, p t) (fst g, q t) = false)
  /\ (forall t, (t < horizon I)%nat ->
        clash I (fst f, p t, p (S t)) (fst g, q t, q (S t)) = false).

Definition is_plan (plan : list flight) : Prop :=
  Forall2 (fun drone f => fst f = fst drone /\ is_flight (snd drone) f) (team I) plan
  /\ ForallOrdPairs apart plan.

(** What is seen of a group from a state. *)
Definition amount (g : group) (k t : nat) (s : state) : Z :=
  sumZ (map snd (filter (fun v => Pos.eqb (fst v) g) (sees I k t s))).

(** What a plan sees of a group. *)
Definition seen (plan : list flight) (g : group) : Z :=
  sumZ (map (fun f => total (S (horizon I)) (fun t => amount g (fst f) t (snd f t))) plan).

Definition return_value (r : return_of) (z : R) : R :=
  match r with Root => sqrt z | AtMost k => Rmin z (IZR k) end.

Definition worth (g : group) (z : Z) : R :=
  (IZR (weight I g) / IZR (weight_unit I)
   * return_value (return_by I g) (IZR z / IZR (amount_unit I)))%R.

Definition groups : list group := map Pos.of_succ_nat (seq 0 (n_groups I)).

Definition bonuses (f : flight) : Z :=
  total (horizon I) (fun t => bonus I (fst f) (snd f t) (snd f (S t))).

(** The sum over groups of weight * return of what is seen of it, and the rewards for moves. *)
Definition J (plan : list flight) : R :=
  (sumR (map (fun g => worth g (seen plan g)) groups)
   + IZR (sumZ (map bonuses plan)) / IZR (weight_unit I))%R.

End Plans.
