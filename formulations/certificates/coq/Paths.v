(** The paths of all drones together: value iteration over the joint states that plans above a target
    may visit.  Of all ways to a joint state only the best is kept; drones of one class are
    exchangeable.

    The iteration begins at step 0 or at a later step. In the second case, a search finds all joint
    states of that step that plans above the target may visit. From these, paths are explored to the
    end, and the prices bound what was collected before the step. From those that may still exceed
    the target, paths are then explored back to step 0, with the worth of all later steps known. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation FMapPositive.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search Narrowing Joints Steps Moves Staged.
Import ListNotations.
Open Scope Z_scope.

(** * The iteration *)

Section Paths.
Variables (I : instance) (C : certificate) (coarse : Z).
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.
Notation T := (horizon I).
Notation M := (numbers C).
Notation rs := (all_rows C []).
Notation search := (search I C coarse memory advise mind).
Variables (N : narrowing) (target : Z) (Vs : list (nat * list (PM.t (option Z)))).

(** The most that a drone in a state of step t collects after it, less what rows charge for the state; no
    entry if no path leads to the end. *)
Definition futures (t : nat) : by_state :=
  let prices := u_prices (now (at_ N t)) in
  map (fun k => (k, build_map (fun s v => match v with Some v' => Some (v' - number_of prices k s) | None => None end)
                              (nth t (of_class [] Vs k) (PM.empty _)))) (classes I).

(** The constants of the steps after t, less what moves between these save, and the rows from t on. *)
Definition rest (t : nat) : Z :=
  total (T - t) (fun i => u_constant (now (at_ N (S t + i)))) - total (pred (T - t)) (fun i => saved N (S t + i))
  + sumZ (map (fun r => if Nat.leb t (step_of (used r)) then multiplier r else 0) rs).

(** What searches for the joint states of a step need. others: constants and rows of the steps that are
    not explored yet; beyond: the most that a drone in a state collects at these steps; candidates: the
    states of each class, priced at the negative of that. *)
Record side := Side {
  groups_at : list group; others : Z; beyond : by_state; candidates : list (nat * PM.t candidate) }.

(** What a state must be paid for, so that a joint state's profit includes what is beyond. *)
Definition price_of (beyond : by_state) (k : nat) : state -> option Z :=
  let paths := map_of beyond k in fun s => option_map Z.opp (PM.find s paths).

Definition side_of (t : nat) (others : Z) (beyond : by_state) : side :=
  let gs := step_groups I C t in Side gs others beyond (candidates_at I coarse (at_ N t) gs t (price_of beyond)).

Definition beyond_in (sd : side) (c : candidate) : Z := number_of (beyond sd) (class_of c) (state_in c).

Definition take_joint (sd : side) (t : nat) (known threshold : Z) (l : list candidate) (m : joints) : joints :=
  let worth := exact_of I C (groups_at sd) l in
  if enough (at_ N t) l worth && (threshold <? worth - sum named (price named) l)
  then insert (Ordered.sort (map taken l)) (known + worth + sumZ (map (fun c => - price named c - beyond_in sd c) l)) m
  else m.

(** Adds the joint states of step t to which the team can move from a joint state. known: the worth of
    the steps explored so far. *)
Definition explore (sd : side) (t : nat) (known : Z) (conflict : named -> named -> bool) (p : pool candidate) : joints -> joints :=
  let threshold := target - known - others sd in
  search (fun _ => threshold) (take_joint sd t known threshold) conflict (groups_at sd) (at_ N t) p.

(** ** From step 0 on *)

Definition onward (t : nat) : side := side_of t (rest t) (futures t).

Definition first_joints : joints :=
  let sd := onward 0 in
  explore sd 0 0 (places_meet I)
    (map (fun d => (1%nat, flat_map (choice I (of_candidates (candidates sd) (fst d)) (fst d) xH (fun _ => 0)) (snd d))) (team I)) (PM.empty _).

(** Adds the joint states of the step after t that follow a joint state of step t. *)
Definition following (sd : side) (t : nat) (jv : joint * Z) : joints -> joints :=
  explore sd (S t) (snd jv) (ways_meet I) (pools_in I (candidates sd) (reward I C) t (fst jv)).

Definition next_joints (t : nat) (m : joints) : joints :=
  let sd := onward (S t) in fold_left (fun found jv => following sd t jv found) (listed m) (PM.empty _).

Fixpoint reached (t : nat) : joints :=
  match t with O => first_joints | S t' => next_joints t' (reached t') end.

(** ** From a later step to the end, then back to step 0 *)

Variable Us : list (nat * list (PM.t Z)).

(** The value of the best path into each state of a step, less the value of the drone's best path. *)
Definition pasts (t : nat) : by_state := map (fun kU => (fst kU, nth t (snd kU) (PM.empty Z))) Us.

(** The constants of the steps before t, less what moves between these save, the rows there, and the values
    of all drones' best paths. *)
Definition begun (t : nat) : Z :=
  total t (fun j => u_constant (now (at_ N j))) - total (pred t) (saved N)
  + sumZ (map (fun r => if Nat.ltb (step_of (used r)) t then multiplier r else 0) rs)
  + match team_best (fun k => first_of (of_class [] Vs k)) (team I) with Some b => b | None => 0 end.

Definition before_all (into : by_state) (j : joint) : Z := sumZ (map (fun ks => number_of into (fst ks) (snd ks)) j).

Definition take_first (st : step) (gs : list group) (l : list candidate) (m : joints) : joints :=
  let worth := exact_of I C gs l in
  if enough st l worth then insert (Ordered.sort (map taken l)) worth m else m.

(** The states of a class that paths lead through. Their charges are also their prices, so that a joint
    state counts if its profit is at least the floor. *)
Definition first_choices (st : step) (gs : list group) (t : nat) (into : by_state) (k : nat) : list candidate :=
  let later := map_of (futures t) k in
  let before := map_of into k in
  flat_map (fun sv : state * Z => let s := fst sv in
    match PM.find s later, PM.find s before with
    | Some _, Some _ => [step_candidate I coarse st gs t k s (number_of (charges st) k s)]
    | _, _ => []
    end) (PM.elements (map_of (u_prices (now st)) k)).

(** The joint states of a step that plans above the target may visit, with the worth of the step. *)
Definition joints_at (t : nat) : joints :=
  let st := at_ N t in let gs := step_groups I C t in let into := pasts t in
  search (fun _ => floor st - 1) (take_first st gs) (places_meet I) gs st
    (map (fun k => (size I k, first_choices st gs t into k)) (classes I)) (PM.empty _).

(** These joint states with the largest worth of this step and all earlier ones. *)
Definition with_ways (t : nat) (m : joints) : list (joint * Z) :=
  let into := pasts t in let before := begun t in
  map (fun jv => (fst jv, before + before_all into (fst jv) + snd jv)) (listed m).

(** Moves of the team: each joint state with its value, and the joint states that follow it. *)
Definition team_moves : Type := list (joint * Z * list (joint * Z)).

Definition ends (moves : team_moves) : joints :=
  fold_left (fun found move => fold_left (fun found jv => insert (fst jv) (snd jv) found) (snd move) found) moves (PM.empty _).

(** For each joint state at which moves begin, the most that is collected by one of them and later. *)
Definition collected (after : joints) (moves : team_moves) : joints :=
  fold_left (fun found move =>
    fold_left (fun found jv => match value_at (fst jv) after with
                               | Some g => insert (fst (fst move)) (snd jv - snd (fst move) + g) found
                               | None => found
                               end) (snd move) found) moves (PM.empty _).

(** The most that is collected after each joint state of step t, in n steps. *)
Fixpoint gains (n t : nat) (l : list (joint * Z)) : joints :=
  match n with
  | O => fold_left (fun found jv => insert (fst jv) 0 found) l (PM.empty _)
  | S n' =>
      let sd := onward (S t) in
      let moves := map (fun jv => (jv, listed (following sd t jv (PM.empty _)))) l in
      collected (gains n' (S t) (listed (ends moves))) moves
  end.

(** The joint states of a step from which paths to the end may exceed the target, with the largest worth
    of this step and all later ones. *)
Definition joints_from (t : nat) : joints :=
  let m := joints_at t in
  let after := gains (T - t) t (with_ways t m) in
  let into := pasts t in let before := begun t in
  fold_left (fun found jv => match value_at (fst jv) after with
      | Some g => if target <? before + before_all into (fst jv) + snd jv + g
                  then insert (fst jv) (snd jv + g) found else found
      | None => found
      end) (listed m) (PM.empty _).

(** For each state of the step after t, the states of step t from which a drone of a class can move to it. *)
Definition tails (t k : nat) : PM.t (list state) :=
  fold_left (fun m s => fold_left (fun m s' => PM.add s' (s :: match PM.find s' m with Some l => l | None => [] end) m)
                                  (moves I k t s) m)
            (map fst (PM.elements (map_of (u_prices (now (at_ N t))) k))) (PM.empty _).

Definition ways_back_meet (a b : named) : bool :=
  places_meet I a b
  || (let way (n : named) := let '((k, p), (to, _)) := n in (k, p, to) in
      clash I (way a) (way b) && clash I (way b) (way a)).

Definition pools_back (sd : side) (from : list (nat * PM.t (list state))) (j : joint) : pool candidate :=
  map (fun ks => let (k, s) := ks : nat * state in
         (1%nat, flat_map (choice I (of_candidates (candidates sd) k) k (place I k s) (fun s' => reward I C k s' s))
                          (match PM.find s (of_class (PM.empty _) from k) with Some l => l | None => [] end))) j.

(** The joint states of step t from which the team can move to given ones of the next step. *)
Definition joints_before (t : nat) (m : joints) : joints :=
  let sd := side_of t (begun t) (pasts t) in
  let from := map (fun k => (k, tails t k)) (classes I) in
  fold_left (fun found jv => explore sd t (snd jv) ways_back_meet (pools_back sd from (fst jv)) found) (listed m) (PM.empty _).

Fixpoint back (t : nat) (m : joints) : joints :=
  match t with O => m | S t' => back t' (joints_before t' m) end.

(** The drones' starts, if each drone has only one. *)
Fixpoint only_starts (drones : list (nat * list state)) : option joint :=
  match drones with
  | [] => Some []
  | (k, [s]) :: rest => match only_starts rest with Some j => Some ((k, s) :: j) | None => None end
  | _ => None
  end.

Definition may_begin (j : joint) : bool :=
  match only_starts (team I) with Some starts => same_drones j starts | None => true end.

(** The joint states of step 0 at which plans above the target may begin, with the largest worth of such
    a plan. *)
Definition paths_through (t : nat) : list (joint * Z) :=
  filter (fun jv => may_begin (fst jv)) (listed (back t (joints_from t))).

Definition most_of (l : list (joint * Z)) : Z := fold_left (fun b jv => Z.max b (snd jv)) l target.
(** * Soundness *)

Variable plan : list flight.
Hypothesis ok : staged_numbers_ok I C coarse = true.
Hypothesis planned : is_plan I plan.
Hypothesis above : (IZR target < J I plan * IZR (precision M))%R.
Hypothesis narrow : inv I C plan N.
Hypothesis swept : Vs = sweep_all I C N.
Hypothesis swept_so_far : Us = sweep_so_far I C N Vs.

Notation FR := (FR I C plan).
Notation flown := (flown_candidate I C coarse).

Lemma future_ok f t : In f plan -> (t <= T)%nat -> exists a, PM.find (snd f t) (map_of (futures t) (fst f)) = Some a
  /\ to_go (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) (T - t) t - number_of (u_prices (now (at_ N t))) (fst f) (snd f t) <= a.
Proof.
  intros Hf Ht. pose proof (to_go_ok I C plan planned N f narrow Hf) as H.
  destruct (Forall2_seq_nth _ (PM.empty _) _ _ _ H t ltac:(lia)) as [v [Ev Hv]]. rewrite Nat.add_0_l in Ev, Hv.
  exists (v - number_of (u_prices (now (at_ N t))) (fst f) (snd f t)). split; [|lia].
  unfold futures. cbv zeta. rewrite (map_of_map I) by (apply (class_in I plan planned), Hf).
  apply find_build_map with (u := Some v); [|reflexivity].
  rewrite swept. unfold sweep_all. rewrite of_class_map by (apply (class_in I plan planned), Hf). exact Ev.
Qed.

Definition rewards_at (t : nat) : Z := sumZ (map (fun f => reward I C (fst f) (snd f t) (snd f (S t))) plan).

(** What a plan is worth up to step t. *)
Definition G (t : nat) : R := (sumR (map FR (seq 0 (S t))) + IZR (total t rewards_at))%R.

Lemma J_below : (J I plan * IZR (precision M) <= G T)%R.
Proof.
  pose proof (units_fine I C coarse ok) as Hu. pose proof (groups_fine I C coarse ok) as Hg.
  pose proof (worth_steps I M Hu Hg plan (views_fine I C coarse plan ok planned)) as HW.
  pose proof (bonuses_R I C [] plan (numbers_fine I C coarse ok)) as HB.
  pose proof (IZR_pos _ (precision_pos I C coarse ok)) as Pp.
  unfold J, G. rewrite Rmult_plus_distr_r. apply Rplus_le_compat.
  - unfold Narrowing.FR. rewrite sumR_scale, Rmult_comm. apply Rmult_le_compat_l; [lra | exact HW].
  - apply (Rmult_le_compat_r (IZR (precision M))) in HB; [|lra].
    unfold Rdiv in HB at 2. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in HB by lra.
    eapply Rle_trans; [exact HB|]. apply Req_le. f_equal. unfold rewards_at. rewrite total_sum. reflexivity.
Qed.

Lemma total_from n t0 t (f : nat -> Z) :
  total n (fun i => if Nat.eqb t0 (t + i) then f (t + i)%nat else 0) = if (Nat.leb t t0 && Nat.ltb t0 (t + n))%bool then f t0 else 0.
Proof.
  induction n as [|n IH]; cbn [total].
  - destruct (Nat.leb_spec t t0), (Nat.ltb_spec t0 (t + 0)); simpl; try reflexivity; lia.
  - rewrite IH. destruct (Nat.leb_spec t t0), (Nat.ltb_spec t0 (t + n)), (Nat.ltb_spec t0 (t + S n)), (Nat.eqb_spec t0 (t + n)); simpl; try lia; subst; lia.
Qed.

(** Rows are charged no more than their multipliers, for those of their uses that count. *)
Lemma charges_at_most (uses : resource -> flight -> Z) (counts : resource -> bool) : (forall r f, uses r f <= if counts r then path_uses I r f else 0) ->
  sumZ (map (fun f : flight => sumZ (map (fun r => sign r * multiplier r * uses (used r) f) rs)) plan)
  <= sumZ (map (fun r => if counts (used r) then multiplier r else 0) rs).
Proof.
  intros Huses. rewrite sumZ_swap. apply sumZ_le. intros r Hr. rewrite sumZ_scale.
  pose proof (ok_parts I C [] (numbers_fine I C coarse ok)) as [_ [_ [Hrules _]]].
  unfold all_rows in Hr. rewrite app_nil_r in Hr. rewrite forallb_forall in Hrules. specialize (Hrules r Hr).
  pose proof (rule_holds I plan r Hrules (proj2 planned)) as Hh.
  unfold rule_ok, row_ok in Hrules. split_andb. to_Z.
  assert (Es : sign r = 1) by (unfold sign; match goal with H : at_most r = true |- _ => rewrite H; reflexivity end).
  unfold holds in Hh. rewrite Es in *.
  assert (Hle : sumZ (map (uses (used r)) plan) <= if counts (used r) then plan_uses I (used r) plan else 0).
  { unfold plan_uses. replace (if counts (used r) then sumZ (map (path_uses I (used r)) plan) else 0)
      with (sumZ (map (fun f => if counts (used r) then path_uses I (used r) f else 0) plan)).
    2:{ destruct (counts (used r)); [reflexivity|]. apply sumZ_zero. reflexivity. }
    apply sumZ_le. intros f _. apply Huses. }
  destruct (counts (used r)); nia.
Qed.

(** Rows from a step on are charged no more than their multipliers. *)
Lemma later_charges t n : (t + n = T)%nat ->
  sumZ (map (fun f => total (S n) (fun i => charge_here I rs (fst f) (t + i) (snd f (t + i)%nat))
                      + total n (fun i => charge_moving I rs (fst f) (t + i) (snd f (t + i)%nat) (snd f (S (t + i))))) plan)
  <= sumZ (map (fun r => if Nat.leb t (step_of (used r)) then multiplier r else 0) rs).
Proof.
  intros Hn.
  set (later := fun r (f : flight) => total (S n) (fun i => if Nat.eqb (step_of r) (t + i) then b2z (uses_here I r (fst f) (snd f (t + i)%nat)) else 0)
     + total n (fun i => if Nat.eqb (step_of r) (t + i) then b2z (uses_moving I r (fst f) (snd f (t + i)%nat) (snd f (S (t + i)))) else 0)).
  eapply Z.le_trans; [apply Z.eq_le_incl | apply (charges_at_most later (fun r => Nat.leb t (step_of r)))].
  - apply sumZ_ext. intros f _. unfold later.
    rewrite (total_ext (S n) _ _ (fun i _ => charge_here_all I rs (fst f) (t + i) (snd f (t + i)%nat))).
    rewrite (total_ext n _ _ (fun i _ => charge_moving_all I rs (fst f) (t + i) (snd f (t + i)%nat) (snd f (S (t + i))))).
    rewrite !total_sum, <- sumZ_add. apply sumZ_ext. intros r _. rewrite !total_scale. lia.
  - intros r f. unfold later.
    rewrite (total_from n (step_of r) t (fun j => b2z (uses_moving I r (fst f) (snd f j) (snd f (S j))))).
    rewrite (total_from (S n) (step_of r) t (fun j => b2z (uses_here I r (fst f) (snd f j)))).
    rewrite path_uses_pick.
    assert (B : forall b, 0 <= b2z b) by (intros []; unfold b2z; lia).
    pose proof (B (uses_moving I r (fst f) (snd f (step_of r)) (snd f (S (step_of r))))) as B1.
    pose proof (B (uses_here I r (fst f) (snd f (step_of r)))) as B2.
    destruct (Nat.leb_spec t (step_of r)),
      (Nat.ltb_spec (step_of r) (t + n)), (Nat.ltb_spec (step_of r) (t + S n)),
      (Nat.ltb_spec (step_of r) (S T)), (Nat.ltb_spec (step_of r) T); cbn [andb]; lia.
Qed.

Lemma total_first n (f : nat -> Z) : total (S n) f = f O + total n (fun i => f (S i)).
Proof. induction n as [|n IH]; [simpl; lia|]. cbn [total] in *. rewrite IH. lia. Qed.

Lemma to_go_sum (price : nat -> state -> Z) (toll : nat -> state -> state -> Z) (p : nat -> state) n : forall t,
  to_go price toll p n t = price t (p t) + total n (fun i => toll (t + i)%nat (p (t + i)%nat) (p (S (t + i))) + price (S (t + i)) (p (S (t + i)))).
Proof.
  induction n as [|n IH]; intros t; cbn [to_go]; [simpl; lia|].
  rewrite IH, total_first, Nat.add_0_r.
  rewrite (total_ext n (fun i => toll (S t + i)%nat (p (S t + i)%nat) (p (S (S t + i))) + price (S (S t + i)) (p (S (S t + i))))
                       (fun i => toll (t + S i)%nat (p (t + S i)%nat) (p (S (t + S i))) + price (S (t + S i)) (p (S (t + S i))))).
  - lia.
  - intros i _. replace (S t + i)%nat with (t + S i)%nat by lia. reflexivity.
Qed.

(** What a plan above the target is worth up to step t, and what its drones get later. *)
Lemma bound_at t : (t <= T)%nat -> (J I plan * IZR (precision M) <= G t + IZR (sumZ (map (fun f =>
    to_go (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) (T - t) t - number_of (u_prices (now (at_ N t))) (fst f) (snd f t))%Z plan) + rest t))%R.
Proof.
  intros Ht. eapply Rle_trans; [apply J_below|]. set (n := (T - t)%nat). assert (Hn : (t + n = T)%nat) by (unfold n; lia).
  pose proof (later_charges t n Hn) as Hlater.
  assert (Hsplit : (G T = G t + sumR (map FR (seq (S t) n)) + IZR (total n (fun i => rewards_at (t + i))))%R).
  { assert (X : forall m, (G (t + m)%nat = G t + sumR (map FR (seq (S t) m)) + IZR (total m (fun i => rewards_at (t + i)%nat)))%R).
    { induction m as [|m IH]; [rewrite Nat.add_0_r; simpl; lra|]. rewrite Nat.add_succ_r. unfold G in *.
      rewrite (seq_S (S (t + m))), (seq_S m), !map_app, !sumR_app. cbn [total map sumR Nat.add] in *. rewrite !plus_IZR in *. lra. }
    specialize (X n). rewrite Hn in X. exact X. }
  rewrite Hsplit, Rplus_assoc. apply Rplus_le_compat_l.
  pose proof (steps_at_most I C plan N (S t) n narrow ltac:(lia)) as Hsteps. rewrite total_add in Hsteps.
  eapply Rle_trans; [apply Rplus_le_compat_r, Hsteps|]. rewrite <- plus_IZR. apply IZR_le. unfold rest. fold n.
  assert (E : sumZ (map (fun f => to_go (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) n t - number_of (u_prices (now (at_ N t))) (fst f) (snd f t)) plan)
    = total n (fun i => rewards_at (t + i) + prices_sum plan (u_prices (now (at_ N (S (t + i))))) (S (t + i)))
      + -1 * sumZ (map (fun f => total (S n) (fun i => charge_here I rs (fst f) (t + i) (snd f (t + i)%nat))
                      + total n (fun i => charge_moving I rs (fst f) (t + i) (snd f (t + i)%nat) (snd f (S (t + i))))) plan)).
  { unfold rewards_at, prices_sum.
    rewrite (total_ext n _ (fun i => sumZ (map (fun f => reward I C (fst f) (snd f (t + i)%nat) (snd f (S (t + i)))
        + number_of (u_prices (now (at_ N (S (t + i))))) (fst f) (snd f (S (t + i)))) plan))) by (intros; rewrite <- sumZ_add; reflexivity).
    rewrite total_sum, <- sumZ_scale, <- sumZ_add. apply sumZ_ext. intros f _.
    rewrite to_go_sum, total_first, Nat.add_0_r.
    rewrite (total_ext n (fun i => toll' I C (fst f) (t + i) (snd f (t + i)%nat) (snd f (S (t + i))) + step_price I C N (fst f) (S (t + i)) (snd f (S (t + i))))
       (fun i => reward I C (fst f) (snd f (t + i)%nat) (snd f (S (t + i))) + number_of (u_prices (now (at_ N (S (t + i))))) (fst f) (snd f (S (t + i)))
          + -1 * (charge_here I rs (fst f) (t + S i) (snd f (t + S i)%nat) + charge_moving I rs (fst f) (t + i) (snd f (t + i)%nat) (snd f (S (t + i)))))).
    - rewrite !total_add, total_scale, !total_add. unfold step_price. lia.
    - intros i _. rewrite Nat.add_succ_r. unfold toll', toll, step_price. lia. }
  rewrite E, total_add.
  change (total n (fun i => paid_now plan N (S t + i)%nat)) with (total n (fun i => prices_sum plan (u_prices (now (at_ N (S (t + i))))) (S (t + i)))).
  lia.
Qed.

(** ** One step *)

Lemma explore_keeps j c sd t known conflict p m : recorded j c m -> recorded j c (explore sd t known conflict p m).
Proof.
  intros H. unfold explore.
  apply (search_keeps I C coarse memory advise mind _ _ _ _ _ (recorded j c)); [|exact H].
  intros l a Ha. unfold take_joint. cbv zeta. destruct (_ && _); [apply insert_old|]; exact Ha.
Qed.

(** The search finds the joint state of a plan above the target, with a value of at least g, if g and
    the bounds on the steps that are not explored yet exceed the J of the plan. *)
Lemma explore_ok t others beyond known conflict (nm : flight -> named) (rewarded : flight -> Z) plan' (p : pool candidate) m g :
  let pr (f : flight) := - number_of beyond (fst f) (snd f t) - rewarded f in
  (t <= T)%nat -> (forall a b, conflict a b = conflict b a) -> Permutation plan plan' ->
  (forall f, In f plan -> taken (flown (at_ N t) t nm pr f) = (fst f, snd f t)) ->
  (J I plan * IZR (precision M) <= g + IZR (sumZ (map (fun f : flight => number_of beyond (fst f) (snd f t)) plan) + others))%R ->
  (g <= IZR known + FR t + IZR (sumZ (map rewarded plan)))%R ->
  fits_together named conflict (map (flown (at_ N t) t nm pr) plan) ->
  Forall2 (fun nl f => fst nl = 1%nat /\ (In f plan -> In (flown (at_ N t) t nm pr f) (snd nl))) p plan' ->
  recorded (Ordered.sort (joint_of plan' t)) g (explore (side_of t others beyond) t known conflict p m).
Proof.
  intros pr Ht Hsym Hperm Htaken Hbound HG Hfits Hp. set (st := at_ N t) in *. set (cf := flown st t nm pr) in *.
  set (gs := step_groups I C t). set (sd := side_of t others beyond). set (threshold := target - known - others).
  assert (Hinv : step_inv I C plan t st) by (apply narrow; exact Ht).
  set (profit := profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of I C coarse gs)).
  set (P := fun (l : list candidate) (m : joints) => (IZR threshold < profit l)%R ->
    recorded (Ordered.sort (map taken l)) (IZR known + F named (amount_unit I) (weight_unit I) (precision M) (specs_of I C coarse gs) l
       + IZR (sum named (fun c => - price named c - beyond_in sd c)%Z l))%R m).
  assert (HP : P (map cf plan') (explore sd t known conflict p m)).
  { apply (drones_searched I C coarse memory advise mind plan ok planned st t conflict nm pr Ht Hinv Hsym Hfits
      (fun _ => threshold) (take_joint sd t known threshold) P); [ | | |exact Hperm | exact Hp].
    - intros l a _ H H'. fold gs in H. fold profit in H. lra.
    - intros l a Hc H. unfold take_joint. cbv zeta. change (groups_at sd) with gs.
      pose proof (counting_enough I C coarse ok st t conflict l Hc) as He. pose proof (exact_worth_of I C coarse ok st t conflict l Hc) as HE.
      fold gs in He, HE. fold st. rewrite He.
      assert (Hlt : threshold < exact_of I C gs l - sum named (price named) l).
      { apply lt_IZR. rewrite minus_IZR. unfold profit, profitR in H. lra. }
      apply Z.ltb_lt in Hlt. rewrite Hlt. simpl. apply insert_new. rewrite !plus_IZR. apply Rplus_le_compat_r, Rplus_le_compat_l, HE.
    - intros l l' a H H'. unfold take_joint. cbv zeta. destruct (_ && _); [apply insert_old|]; apply H, H'. }
  set (fut := fun f : flight => number_of beyond (fst f) (snd f t)) in *.
  assert (Eprices : sumZ (map pr plan) = -1 * sumZ (map fut plan) + -1 * sumZ (map rewarded plan)).
  { rewrite <- !sumZ_scale, <- sumZ_add. apply sumZ_ext. intros f _. unfold pr, fut. lia. }
  assert (Hrew : sum named (fun c => - price named c - beyond_in sd c) (map cf plan') = sumZ (map rewarded plan)).
  { unfold cf. rewrite (flown_sum I C coarse plan st t nm pr plan' _ Hperm). apply sumZ_ext. intros f Hf.
    specialize (Htaken f Hf). unfold taken in Htaken. injection Htaken as E1 E2. unfold beyond_in. fold cf in E1, E2 |- *. rewrite E1, E2.
    change (- pr f - number_of beyond (fst f) (snd f t) = rewarded f). unfold pr. lia. }
  pose proof (flown_profit I C coarse plan ok planned st t nm pr Ht plan' Hperm) as Eprofit.
  pose proof (flown_worth_in I C coarse plan ok planned st t nm pr Ht plan' Hperm) as Eworth.
  fold cf gs in Eprofit, Eworth. unfold P in HP. fold profit in Eprofit. rewrite Eprofit, Eworth, Hrew, Eprices in HP.
  assert (EJ : map taken (map cf plan') = joint_of plan' t).
  { rewrite map_map. apply map_ext_in. intros f Hf. apply Htaken, (Permutation_in f (Permutation_sym Hperm) Hf). }
  rewrite EJ in HP. eapply recorded_less; [exact HG|]. apply HP. unfold threshold.
  rewrite !plus_IZR, !mult_IZR, !minus_IZR in *. lra.
Qed.

(** The same for steps explored from step 0 on. *)
Lemma explored_onward t known conflict (nm : flight -> named) (rewarded : flight -> Z) plan' (p : pool candidate) m g :
  let pr (f : flight) := - number_of (futures t) (fst f) (snd f t) - rewarded f in
  (t <= T)%nat -> (forall a b, conflict a b = conflict b a) -> Permutation plan plan' ->
  (forall f, In f plan -> taken (flown (at_ N t) t nm pr f) = (fst f, snd f t)) -> (G t <= g)%R ->
  (g <= IZR known + FR t + IZR (sumZ (map rewarded plan)))%R ->
  fits_together named conflict (map (flown (at_ N t) t nm pr) plan) ->
  Forall2 (fun nl f => fst nl = 1%nat /\ (In f plan -> In (flown (at_ N t) t nm pr f) (snd nl))) p plan' ->
  recorded (Ordered.sort (joint_of plan' t)) g (explore (onward t) t known conflict p m).
Proof.
  intros pr Ht Hsym Hperm Htaken Hmore HG Hfits Hp.
  apply (explore_ok t (rest t) (futures t) known conflict nm rewarded plan'); try assumption.
  eapply Rle_trans; [apply (bound_at t Ht)|]. apply Rplus_le_compat; [exact Hmore|]. apply IZR_le, Z.add_le_mono_r, sumZ_le.
  intros f Hf. destruct (future_ok f t Hf Ht) as [a [Ea Ha]]. unfold number_of at 2. rewrite Ea. exact Ha.
Qed.

Lemma price_found beyond k s a : PM.find s (map_of beyond k) = Some a -> price_of beyond k s = Some (- number_of beyond k s).
Proof. intros E. unfold price_of, number_of. rewrite E. reflexivity. Qed.

Lemma future_price f t : In f plan -> (t <= T)%nat ->
  price_of (futures t) (fst f) (snd f t) = Some (- number_of (futures t) (fst f) (snd f t)).
Proof. intros Hf Ht. destruct (future_ok f t Hf Ht) as [a [Ea _]]. exact (price_found _ _ _ a Ea). Qed.

Lemma first_joints_ok : recorded (Ordered.sort (joint_of plan 0)) (G 0) first_joints.
Proof.
  unfold first_joints. cbv zeta.
  apply (explored_onward 0 0 (places_meet I) (fun f => moved I (fst f) xH (snd f O)) (fun _ => 0) plan);
    [lia | apply places_meet_symmetric | reflexivity | reflexivity | apply Rle_refl | | |].
  - unfold G. simpl. replace (sumZ (map (fun _ : flight => 0) plan)) with 0 by (symmetry; apply sumZ_zero; reflexivity). lra.
  - destruct planned as [_ H]. unfold fits_together. clear - H.
    induction H as [|f l Hf H IH]; simpl; [constructor|]. constructor; [|exact IH].
    rewrite Forall_map. apply Forall_forall. intros g Hg. rewrite Forall_forall in Hf.
    unfold places_meet. simpl. destruct (Hf g Hg) as [Hm _]. rewrite (Hm O ltac:(lia)). reflexivity.
  - match goal with |- Forall2 ?P (map ?g _) _ =>
      enough (X : forall ds fs, Forall2 (fun d f => fst f = fst d /\ is_flight I (snd d) f) ds fs -> Forall2 P (map g ds) fs)
        by exact (X _ _ (proj1 planned)) end.
    induction 1 as [|d f ds fs [E1 E2] HF IH]; cbn [map]; constructor; [|exact IH].
    cbn [fst snd]. split; [reflexivity|]. intros Hf. apply in_flat_map. exists (snd f O). split.
    + destruct f as [k q]. destruct E2 as [Hs _]. exact Hs.
    + rewrite <- E1. apply (choice_found I C coarse plan planned) with (rewarded := fun _ => 0) (p := - number_of (futures 0) (fst f) (snd f O));
        [exact Hf | apply narrow; lia | apply future_price; [exact Hf | lia] | reflexivity | reflexivity].
Qed.

(** What is in order is the plan's joint state, its drones in some order. *)
Lemma in_order plan' t c m : Permutation plan plan' -> recorded (Ordered.sort (joint_of plan' t)) c m ->
  exists plan'', Permutation plan plan'' /\ recorded (joint_of plan'' t) c m.
Proof.
  intros Hperm H. destruct (reordered plan plan' t _ Hperm (Ordered.Permuted_sort _)) as [plan'' [Hperm' E]].
  exists plan''. split; [exact Hperm'|]. rewrite <- E. exact H.
Qed.

Lemma G_next t : G (S t) = (G t + FR (S t) + IZR (rewards_at t))%R.
Proof. unfold G. rewrite (seq_S (S t)), map_app, sumR_app. cbn [total map sumR Nat.add]. rewrite plus_IZR. lra. Qed.

(** From the joint state of a plan its next one is found, with the worth that the step adds. *)
Lemma following_ok t v plan' m : (S t <= T)%nat -> Permutation plan plan' -> (G t <= IZR v)%R ->
  recorded (Ordered.sort (joint_of plan' (S t))) (IZR v + FR (S t) + IZR (rewards_at t))%R
    (following (onward (S t)) t (joint_of plan' t, v) m).
Proof.
  intros Ht Hperm Hv. unfold following. cbn [fst snd].
  apply (explored_onward (S t) v (ways_meet I) (fun f => moved I (fst f) (place I (fst f) (snd f t)) (snd f (S t)))
    (fun f => reward I C (fst f) (snd f t) (snd f (S t))) plan');
    [exact Ht | apply ways_meet_symmetric | exact Hperm | reflexivity | | apply Rle_refl | |].
  - rewrite G_next. lra.
  - apply (ways_fit I plan planned _ t Ht). reflexivity.
  - apply (pools_in_ok I C coarse plan planned); [exact Ht | apply narrow, Ht | exact Hperm|].
    intros f Hf. split; [reflexivity|]. exists (- number_of (futures (S t)) (fst f) (snd f (S t))).
    split; [apply future_price; assumption | reflexivity].
Qed.

Lemma following_keeps j c sd t jv m : recorded j c m -> recorded j c (following sd t jv m).
Proof. apply explore_keeps. Qed.

(** The joint state of the plan is recorded, its drones in some order. *)
Definition met (t : nat) (c : R) (m : joints) : Prop :=
  exists plan', Permutation plan plan' /\ recorded (joint_of plan' t) c m.

Lemma reached_ok t : (t <= T)%nat -> met t (G t) (reached t).
Proof.
  induction t as [|t IH]; intros Ht.
  { apply (in_order plan 0); [reflexivity | apply first_joints_ok]. }
  destruct (IH ltac:(lia)) as [plan' [Hperm Hrec]]. apply (in_order plan' (S t)); [exact Hperm|].
  destruct (recorded_listed _ _ _ Hrec) as [v [Hin Hv]]. cbn [reached]. unfold next_joints. cbv zeta.
  apply fold_records with (b := (joint_of plan' t, v)); [intros; apply following_keeps; assumption | | exact Hin].
  intros m. eapply recorded_less; [|apply (following_ok t v plan' m Ht Hperm Hv)].
  rewrite G_next. lra.
Qed.

(** ** The joint states of a step *)

(** Rows before a step are charged no more than their multipliers. *)
Lemma earlier_charges t : (t <= T)%nat ->
  sumZ (map (fun f => total t (fun j => charge_here I rs (fst f) j (snd f j) + charge_moving I rs (fst f) j (snd f j) (snd f (S j)))) plan)
  <= sumZ (map (fun r => if Nat.ltb (step_of (used r)) t then multiplier r else 0) rs).
Proof.
  intros Ht.
  set (sooner := fun r (f : flight) => total t (fun j => if Nat.eqb (step_of r) j then b2z (uses_here I r (fst f) (snd f j)) else 0)
     + total t (fun j => if Nat.eqb (step_of r) j then b2z (uses_moving I r (fst f) (snd f j) (snd f (S j))) else 0)).
  eapply Z.le_trans; [apply Z.eq_le_incl | apply (charges_at_most sooner (fun r => Nat.ltb (step_of r) t))].
  - apply sumZ_ext. intros f _. unfold sooner.
    rewrite (total_ext _ _ (fun j => sumZ (map (fun r => sign r * multiplier r * ((if Nat.eqb (step_of (used r)) j then b2z (uses_here I (used r) (fst f) (snd f j)) else 0)
        + (if Nat.eqb (step_of (used r)) j then b2z (uses_moving I (used r) (fst f) (snd f j) (snd f (S j))) else 0))) rs))).
    + rewrite total_sum. apply sumZ_ext. intros r _. rewrite total_scale, total_add. reflexivity.
    + intros j _. rewrite charge_moving_all, charge_here_all, <- sumZ_add. apply sumZ_ext. intros r _. lia.
  - intros r f. unfold sooner.
    rewrite (total_pick t (step_of r) (fun j => b2z (uses_here I r (fst f) (snd f j)))).
    rewrite (total_pick t (step_of r) (fun j => b2z (uses_moving I r (fst f) (snd f j) (snd f (S j))))).
    rewrite path_uses_pick.
    destruct (Nat.ltb_spec (step_of r) t), (Nat.ltb_spec (step_of r) (S T)), (Nat.ltb_spec (step_of r) T); lia.
Qed.

(** What a drone collects before a step is at most the values of its best path and of its state. *)
Lemma past_ok d f t : paired I C plan N d f -> (t <= T)%nat ->
  (exists u, PM.find (snd f t) (map_of (pasts t) (fst f)) = Some u)
  /\ so_far (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) t
     <= best_number I C N d + number_of (pasts t) (fst f) (snd f t).
Proof.
  intros Hp Ht. destruct (so_far_ok I C plan planned N d f t narrow Hp Ht) as [u [Eu Hu]].
  pose proof (class_in I plan planned f (proj2 (proj2 Hp))) as Hk.
  assert (E : map_of (pasts t) (fst f) = nth t (of_class [] (sweep_so_far I C N Vs) (fst f)) (PM.empty Z)).
  { unfold pasts. rewrite swept_so_far. unfold sweep_so_far. rewrite map_map. cbn [fst snd].
    rewrite (of_class_map [] (fun k => left_forward I N k (step_price I C N k) (toll' I C k)
      (map (fun sv => (fst sv, - snd sv)) (bests_of I (of_class [] Vs k) k)))) by exact Hk.
    apply (map_of_map I (fun k => nth t (left_forward I N k (step_price I C N k) (toll' I C k)
      (map (fun sv => (fst sv, - snd sv)) (bests_of I (of_class [] Vs k) k))) (PM.empty Z))), Hk. }
  rewrite <- swept in Eu. rewrite <- E in Eu. split; [exists u; exact Eu|]. unfold number_of. rewrite Eu. exact Hu.
Qed.

Definition into_sum (t : nat) : Z := sumZ (map (fun f => number_of (pasts t) (fst f) (snd f t)) plan).

(** What a plan collects up to step t is at most the bound on earlier steps and the worth of step t. *)
Lemma begun_ok t : (t <= T)%nat -> (G t <= IZR (begun t + into_sum t) + FR t)%R.
Proof.
  intros Ht.
  set (priced := fun j => prices_sum plan (u_prices (now (at_ N j))) j).
  pose proof (steps_at_most I C plan N 0 t narrow ltac:(lia)) as Hworth. rewrite total_add in Hworth.
  change (total t (fun i => paid_now plan N (0 + i)%nat)) with (total t priced) in Hworth.
  change (total (pred t) (fun i => saved N (0 + i)%nat)) with (total (pred t) (saved N)) in Hworth.
  change (total t (fun i => u_constant (now (at_ N (0 + i)%nat)))) with (total t (fun j => u_constant (now (at_ N j)))) in Hworth.
  assert (Hpast : sumZ (map (fun f => so_far (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) t) plan)
      = total t priced + total t rewards_at
        + -1 * sumZ (map (fun f => total t (fun j => charge_here I rs (fst f) j (snd f j) + charge_moving I rs (fst f) j (snd f j) (snd f (S j)))) plan)).
  { unfold priced, prices_sum, rewards_at. rewrite !total_sum, <- sumZ_scale, <- !sumZ_add. apply sumZ_ext. intros f _.
    unfold so_far. rewrite <- total_scale, <- !total_add. apply total_ext. intros j _. unfold step_price, toll', toll. lia. }
  pose proof (earlier_charges t Ht) as Hcharges.
  assert (Hsums : forall ds fs, Forall2 (paired I C plan N) ds fs ->
    sumZ (map (fun f => so_far (step_price I C N (fst f)) (toll' I C (fst f)) (snd f) t) fs)
    <= sumZ (map (best_number I C N) ds) + sumZ (map (fun f => number_of (pasts t) (fst f) (snd f t)) fs)).
  { induction 1 as [|d f ds fs Hp H IH]; cbn [map sumZ]; [lia|]. pose proof (proj2 (past_ok d f t Hp Ht)). lia. }
  specialize (Hsums _ _ (team_pairs I C plan planned N narrow)). fold (into_sum t) in Hsums.
  assert (Hbests : match team_best (fun k => first_of (of_class [] Vs k)) (team I) with Some b => b | None => 0 end
      = sumZ (map (best_number I C N) (team I))).
  { destruct (team_best_is I C plan planned N narrow) as [EB _]. unfold left_bound in EB. rewrite <- swept in EB.
    destruct (team_best _ _) as [b|]; [|discriminate]. injection EB as EB. lia. }
  unfold G, begun. rewrite Hbests, (seq_S t), map_app, sumR_app. cbn [map sumR Nat.add].
  apply Rle_trans with (IZR (total t (fun j => u_constant (now (at_ N j))) + total t priced - total (pred t) (saved N) + total t rewards_at) + FR t)%R.
  - rewrite !plus_IZR, !minus_IZR in *. rewrite !plus_IZR in *. lra.
  - apply Rplus_le_compat_r, IZR_le. lia.
Qed.

Lemma joints_at_ok t : (t <= T)%nat -> met t (FR t) (joints_at t).
Proof.
  intros Ht. set (st := at_ N t). set (gs := step_groups I C t).
  set (pr := fun f : flight => number_of (charges st) (fst f) (snd f t)).
  set (nm := fun f : flight => here I (fst f) (snd f t)). set (cf := flown st t nm pr).
  assert (Hinv : step_inv I C plan t st) by (apply narrow; exact Ht).
  set (worth_in := F named (amount_unit I) (weight_unit I) (precision M) (specs_of I C coarse gs)).
  set (P := fun (l : list candidate) (m : joints) => sum named (price named) l = sum named (charge named) l ->
    exists j, Permutation (map taken l) j /\ recorded j (worth_in l) m).
  assert (HP : P (map cf plan) (joints_at t)).
  { apply (classes_searched I C coarse memory advise mind plan ok planned st t (places_meet I) nm pr Ht Hinv (places_meet_symmetric I)
      (fits_pairs I plan planned cf t Ht (fun f _ => eq_refl)) (fun _ => floor st - 1) (take_first st gs) P).
    - intros l a [[_ [Hfl _]] _] H E. exfalso. unfold profitR in H. rewrite E, minus_IZR in H. lra.
    - intros l a Hc _. unfold take_first. cbv zeta.
      pose proof (counting_enough I C coarse ok st t (places_meet I) l Hc) as He. fold gs in He. rewrite He.
      exists (Ordered.sort (map taken l)). split; [apply Ordered.Permuted_sort|]. apply insert_new.
      exact (exact_worth_of I C coarse ok st t (places_meet I) l Hc).
    - intros l l' a H E. destruct (H E) as [j [Ej Hj]]. exists j. split; [exact Ej|].
      unfold take_first. cbv zeta. destruct (enough _ _ _); [apply insert_old|]; exact Hj.
    - intros l l' a Hp H E. rewrite <- (sum_perm _ (price named) _ _ Hp), <- (sum_perm _ (charge named) _ _ Hp) in E.
      destruct (H E) as [j [Ej Hj]]. exists j. split; [eapply Permutation_trans; [apply Permutation_map, Permutation_sym, Hp | exact Ej]|].
      unfold worth_in. rewrite <- (F_perm _ _ _ _ _ _ _ Hp). exact Hj.
    - intros f Hf. unfold first_choices. cbv zeta. apply in_flat_map.
      destruct Hinv as [HL _]. destruct (HL f Hf) as [v Ev]. exists (snd f t, v). split; [apply PM.elements_correct, Ev|].
      destruct (future_ok f t Hf Ht) as [a [Ea _]]. destruct (paired_of I C plan planned N f narrow Hf) as [d Hd].
      destruct (past_ok d f t Hd Ht) as [[u Eu] _]. cbn [fst]. rewrite Ea, Eu. left. reflexivity. }
  destruct HP as [j [Ej Hj]]; [unfold sum; rewrite !map_map; reflexivity|].
  pose proof (flown_worth_in I C coarse plan ok planned st t nm pr Ht plan (Permutation_refl _)) as Eworth.
  fold cf gs in Eworth. fold worth_in in Eworth. rewrite Eworth in Hj.
  assert (Ejoint : Permutation (joint_of plan t) j).
  { eapply Permutation_trans; [|exact Ej]. unfold joint_of. rewrite map_map. apply Permutation_refl. }
  destruct (reordered plan plan t j (Permutation_refl _) Ejoint) as [plan' [Hperm ->]]. exists plan'. auto.
Qed.

(** ** Onward and back *)

Lemma ends_ok j v move moves : In move moves -> In (j, v) (snd move) -> recorded j (IZR v) (ends moves).
Proof.
  intros Hmove Hin. unfold ends. apply fold_records with (b := move); [| |exact Hmove].
  - intros m x. cbn beta. revert m. induction (snd x) as [|y ys IH]; intros m Hm; simpl; [exact Hm | apply IH, insert_old, Hm].
  - intros m. apply fold_records with (b := (j, v)); [intros; apply insert_old; assumption | | exact Hin].
    intros m0. apply insert_new, Rle_refl.
Qed.

Lemma collected_ok j v after g i w moves l : In (i, w, l) moves -> In (j, v) l -> value_at j after = Some g ->
  recorded i (IZR (v - w + g)) (collected after moves).
Proof.
  intros Hmove Hin Hg. unfold collected. apply fold_records with (b := (i, w, l)); [| |exact Hmove].
  - intros m x. cbn beta. revert m. induction (snd x) as [|y ys IH]; intros m Hm; simpl; [exact Hm|]. apply IH.
    destruct (value_at (fst y) after); [apply insert_old|]; exact Hm.
  - intros m. cbn [fst snd]. apply fold_records with (b := (j, v)); [| |exact Hin].
    + intros m0 x Hm. destruct (value_at (fst x) after); [apply insert_old|]; exact Hm.
    + intros m0. cbn [fst snd]. rewrite Hg. apply insert_new, Rle_refl.
Qed.

Lemma gains_ok n : forall t l plan' v, (t + n = T)%nat -> Permutation plan plan' ->
  In (joint_of plan' t, v) l -> (G t <= IZR v)%R -> recorded (joint_of plan' t) (G T - G t)%R (gains n t l).
Proof.
  induction n as [|n IH]; intros t l plan' v Ht Hperm Hin Hv; cbn [gains].
  - apply fold_records with (b := (joint_of plan' t, v)); [intros; apply insert_old; assumption | | exact Hin].
    intros m. apply insert_new. replace t with T by lia. lra.
  - cbv zeta. set (sd := onward (S t)).
    set (moves := map (fun jv => (jv, listed (following sd t jv (PM.empty _)))) l).
    pose proof (following_ok t v plan' (PM.empty _) ltac:(lia) Hperm Hv) as Hfound. fold sd in Hfound.
    destruct (recorded_listed _ _ _ Hfound) as [v' [Hin' Hv']].
    assert (Hmove : In ((joint_of plan' t, v), listed (following sd t (joint_of plan' t, v) (PM.empty _))) moves).
    { unfold moves. apply in_map_iff. exists (joint_of plan' t, v). split; [reflexivity | exact Hin]. }
    pose proof (ends_ok _ v' _ _ Hmove Hin') as Hend.
    destruct (reordered plan plan' (S t) _ Hperm (Ordered.Permuted_sort _)) as [plan2 [Hperm2 E2]]. rewrite E2 in Hend, Hin'.
    destruct (recorded_listed _ _ _ Hend) as [w [Hinw Hw]]. pose proof (G_next t) as EG.
    pose proof (IH (S t) _ plan2 w ltac:(lia) Hperm2 Hinw ltac:(lra)) as Hafter.
    destruct (recorded_value _ _ _ Hafter) as [g [Eg Hg]].
    eapply recorded_less; [|exact (collected_ok _ v' _ g _ _ _ _ Hmove Hin' Eg)]. rewrite plus_IZR, minus_IZR. lra.
Qed.

(** The worth of a plan from step t on. *)
Definition H (t : nat) : R := (FR t + G T - G t)%R.

Lemma before_all_is plan' t : Permutation plan plan' -> before_all (pasts t) (joint_of plan' t) = into_sum t.
Proof.
  intros Hperm. unfold before_all, into_sum, joint_of. rewrite map_map. cbn [fst snd]. symmetry.
  clear - Hperm. induction Hperm; simpl; lia.
Qed.

Lemma joints_from_ok t : (t <= T)%nat -> met t (H t) (joints_from t).
Proof.
  intros Ht. destruct (joints_at_ok t Ht) as [plan' [Hperm Hrec]]. exists plan'. split; [exact Hperm|].
  destruct (recorded_listed _ _ _ Hrec) as [w [Hin Hw]]. pose proof (begun_ok t Ht) as Hbegun.
  set (v := begun t + before_all (pasts t) (joint_of plan' t) + w).
  assert (Hv : (G t <= IZR v)%R).
  { unfold v. rewrite (before_all_is plan' t Hperm). rewrite !plus_IZR in *. lra. }
  unfold joints_from. cbv zeta. set (after := gains _ _ _).
  assert (Hafter : recorded (joint_of plan' t) (G T - G t)%R after).
  { apply (gains_ok (T - t) t _ plan' v); [lia | exact Hperm | | exact Hv].
    unfold with_ways. apply in_map_iff. exists (joint_of plan' t, w). split; [reflexivity | exact Hin]. }
  destruct (recorded_value _ _ _ Hafter) as [g [Eg Hg]].
  apply fold_records with (b := (joint_of plan' t, w)); [| |exact Hin].
  - intros m x Hm. destruct (value_at (fst x) after); [destruct (_ <? _); [apply insert_old|]|]; exact Hm.
  - intros m. cbn [fst snd]. rewrite Eg. fold v.
    assert (Hlt : target < v + g) by (apply lt_IZR; rewrite plus_IZR; pose proof J_below; lra).
    apply Z.ltb_lt in Hlt. rewrite Hlt. apply insert_new. rewrite plus_IZR. unfold H. lra.
Qed.

Lemma tails_ok t k s s' v : PM.find s (map_of (u_prices (now (at_ N t))) k) = Some v -> In s' (moves I k t s) ->
  exists l, PM.find s' (tails t k) = Some l /\ In s l.
Proof.
  intros Hs Hmove. set (has := fun m : PM.t (list state) => exists l, PM.find s' m = Some l /\ In s l).
  set (put := fun x (m : PM.t (list state)) y => PM.add y (x :: match PM.find y m with Some l => l | None => [] end) m).
  assert (Hput : forall x m y, has m -> has (put x m y)).
  { intros x m y [l [El Hl]]. unfold has, put. destruct (Pos.eq_dec s' y) as [<- | Hne].
    - rewrite PM.gss, El. eexists. split; [reflexivity | right; exact Hl].
    - rewrite PM.gso by exact Hne. exists l. auto. }
  assert (Hputs : forall x ys m, has m -> has (fold_left (put x) ys m)).
  { induction ys as [|y ys IH]; intros m Hm; simpl; [exact Hm | apply IH, Hput, Hm]. }
  assert (Hnew : forall ys m, In s' ys -> has (fold_left (put s) ys m)).
  { induction ys as [|y ys IH]; intros m Hin; [contradiction|]. simpl. destruct Hin as [-> | Hin]; [|apply IH, Hin].
    apply Hputs. unfold has, put. rewrite PM.gss. eexists. split; [reflexivity | left; reflexivity]. }
  assert (Hin : In s (map fst (PM.elements (map_of (u_prices (now (at_ N t))) k)))).
  { apply in_map_iff. exists (s, v). split; [reflexivity | apply PM.elements_correct, Hs]. }
  change (has (fold_left (fun m x => fold_left (put x) (moves I k t x) m) (map fst (PM.elements (map_of (u_prices (now (at_ N t))) k))) (PM.empty _))).
  assert (Hall : forall l m, has m -> has (fold_left (fun m x => fold_left (put x) (moves I k t x) m) l m)).
  { induction l as [|x l IH]; intros m Hm; simpl; [exact Hm | apply IH, Hputs, Hm]. }
  generalize (PM.empty (list state)). revert Hin. generalize (map fst (PM.elements (map_of (u_prices (now (at_ N t))) k))) as l.
  induction l as [|x l IH]; intros Hin m; [contradiction|]. simpl. destruct Hin as [-> | Hin]; [apply Hall, Hnew, Hmove | apply IH, Hin].
Qed.

Lemma ways_back_symmetric a b : ways_back_meet a b = ways_back_meet b a.
Proof.
  unfold ways_back_meet. rewrite places_meet_symmetric. f_equal. destruct a as [[k p] [q s]], b as [[k' p'] [q' s']].
  apply andb_comm.
Qed.

Lemma joints_before_ok t m : (S t <= T)%nat -> met (S t) (H (S t)) m -> met t (H t) (joints_before t m).
Proof.
  intros Ht [plan' [Hperm Hrec]]. apply (in_order plan' t); [exact Hperm|].
  destruct (recorded_listed _ _ _ Hrec) as [v [Hin Hv]]. unfold joints_before. cbv zeta.
  apply fold_records with (b := (joint_of plan' (S t), v)); [intros; apply explore_keeps; assumption | | exact Hin].
  intros m0. cbn [fst snd].
  pose proof (G_next t) as EG.
  assert (Hpast : forall f, In f plan -> exists a, PM.find (snd f t) (map_of (pasts t) (fst f)) = Some a).
  { intros f Hf. destruct (paired_of I C plan planned N f narrow Hf) as [d Hd].
    destruct (past_ok d f t Hd ltac:(lia)) as [Hu _]. exact Hu. }
  apply (explore_ok t (begun t) (pasts t) v ways_back_meet (fun f => moved I (fst f) (place I (fst f) (snd f (S t))) (snd f t))
    (fun f => reward I C (fst f) (snd f t) (snd f (S t))) plan'); [lia | apply ways_back_symmetric | exact Hperm | reflexivity | | | |].
  - change (sumZ (map _ plan)) with (into_sum t). pose proof (begun_ok t ltac:(lia)) as HB. pose proof J_below. unfold H. rewrite !plus_IZR in *. lra.
  - change (sumZ (map _ plan)) with (rewards_at t). unfold H in *. lra.
  - destruct planned as [_ HA]. unfold fits_together. clear - HA Ht.
    induction HA as [|f l Hf HA IH]; simpl; [constructor|]. constructor; [|exact IH].
    rewrite Forall_map. apply Forall_forall. intros g Hg. rewrite Forall_forall in Hf.
    unfold ways_back_meet, places_meet. simpl. destruct (Hf g Hg) as [Hm Hc].
    rewrite (Hm t ltac:(lia)), (Hc t ltac:(lia)). reflexivity.
  - assert (Htails : forall f, In f plan' -> exists l, PM.find (snd f (S t)) (of_class (PM.empty _) (map (fun k => (k, tails t k)) (classes I)) (fst f)) = Some l
        /\ In (snd f t) l).
    { intros f Hf. apply (Permutation_in f (Permutation_sym Hperm)) in Hf.
      rewrite of_class_map by (apply (class_in I plan planned), Hf). destruct narrow as [_ HN]. destruct (HN t ltac:(lia)) as [HL _].
      destruct (HL f Hf) as [p Ep]. apply (tails_ok t (fst f) (snd f t) (snd f (S t)) p Ep).
      destruct (of_plan I plan planned f Hf) as [starts [_ [_ [_ Hm]]]]. apply Hm. lia. }
    unfold joint_of, pools_back. rewrite map_map. clear - Htails Hpast Ht ok planned narrow swept.
    induction plan' as [|f fs IH]; cbn [map]; constructor; [|apply IH; intros; apply Htails; right; assumption].
    cbn [fst snd]. split; [reflexivity|]. intros Hf. destruct (Htails f (or_introl eq_refl)) as [l [El Hl]]. rewrite El.
    apply in_flat_map. exists (snd f t). split; [exact Hl|]. destruct (Hpast f Hf) as [a Ea].
    apply (choice_found I C coarse plan planned) with (rewarded := fun s' => reward I C (fst f) s' (snd f (S t)))
      (p := - number_of (pasts t) (fst f) (snd f t));
      [exact Hf | apply narrow; lia | exact (price_found _ _ _ a Ea) | reflexivity | reflexivity].
Qed.

Lemma back_ok t : forall m, (t <= T)%nat -> met t (H t) m -> met 0 (H 0) (back t m).
Proof.
  induction t as [|t IH]; intros m Ht Hm; [exact Hm|]. cbn [back]. apply IH; [lia|]. apply joints_before_ok; assumption.
Qed.

Lemma most_of_ok j l : recorded_in j (G T) l -> (J I plan * IZR (precision M) <= IZR (most_of l))%R.
Proof.
  intros [v [Hin Hv]]. eapply Rle_trans; [apply J_below|]. eapply Rle_trans; [exact Hv|]. apply IZR_le. unfold most_of.
  assert (Hold : forall l b, b <= fold_left (fun b (jv : joint * Z) => Z.max b (snd jv)) l b).
  { induction l0 as [|x l0 IH]; intros b; simpl; [lia|]. specialize (IH (Z.max b (snd x))). lia. }
  revert Hin. generalize target as b. induction l as [|x l IH]; intros b Hin; [contradiction|].
  simpl. destruct Hin as [-> | Hin]; [|apply IH, Hin]. specialize (Hold l (Z.max b v)). simpl. lia.
Qed.

Lemma paths_ok : (J I plan * IZR (precision M) <= IZR (most_of (listed (reached T))))%R.
Proof.
  destruct (reached_ok T (le_n _)) as [plan' [_ Hrec]]. apply (most_of_ok (joint_of plan' T)), recorded_listed, Hrec.
Qed.

(** A plan begins at the starts. *)
Lemma may_begin_ok plan' : Permutation plan plan' -> may_begin (joint_of plan' 0) = true.
Proof.
  intros Hperm. unfold may_begin. destruct (only_starts (team I)) as [starts|] eqn:E; [|reflexivity]. apply same_drones_ok.
  eapply Permutation_trans; [apply Permutation_map, Permutation_sym, Hperm|]. destruct planned as [HF _].
  assert (Es : joint_of plan 0 = starts).
  { clear - HF E. revert starts E. induction HF as [|d f ds fs [E1 E2] HF IH]; intros starts E; simpl in E; [injection E as <-; reflexivity|].
    destruct d as [k [|s [|s' l]]]; try discriminate. destruct (only_starts ds) as [j|]; [|discriminate]. injection E as <-.
    simpl. rewrite (IH j eq_refl). destruct f as [k' q]. simpl in E1, E2. destruct E2 as [[Hs | []] _]. subst. reflexivity. }
  unfold joint_of in Es. rewrite Es. reflexivity.
Qed.

Lemma paths_through_ok t : (t <= T)%nat -> (J I plan * IZR (precision M) <= IZR (most_of (paths_through t)))%R.
Proof.
  intros Ht. destruct (back_ok t _ Ht (joints_from_ok t Ht)) as [plan' [Hperm Hrec]].
  destruct (recorded_listed _ _ _ Hrec) as [v [Hin Hv]]. apply (most_of_ok (joint_of plan' 0)). exists v. split.
  - unfold paths_through. apply filter_In. split; [exact Hin | apply may_begin_ok, Hperm].
  - replace (G T) with (H 0) by (unfold H, G; simpl; lra). exact Hv.
Qed.
End Paths.

(** * The theorem *)

Section Whole.
Variables (I : instance) (C : certificate) (coarse : Z).
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.
Notation M := (numbers C).

(** What no plan is above, by the paths of all drones; from: the step at which they begin. *)
Definition paths_bound (N : narrowing) (target : Z) (from : nat) : Z :=
  let Vs := sweep_all I C N in
  most_of target (match from with
    | O => listed (reached I C coarse memory advise mind N target Vs (horizon I))
    | S _ => paths_through I C coarse memory advise mind N target Vs (sweep_so_far I C N Vs) from
    end).

(** What no plan is above, by stages, and by the paths of plans above a higher target, if there is
    one; paths_from: the step at which these begin. None: the certificate proves nothing. *)
Definition whole_bound (target : Z) (stages : list stage) (paths_above : option Z) (paths_from : nat) : option Z :=
  match paths_above with
  | None => staged_bound I C coarse memory advise mind target stages
  | Some higher =>
      if staged_numbers_ok I C coarse && (target <=? higher) && Nat.leb paths_from (horizon I) then
        Some (match narrowed I C coarse memory advise mind target stages with
              | None => target
              | Some N =>
                  let by_stages := bound_of I C target N in
                  if by_stages <=? higher then by_stages
                  else Z.min by_stages (match close I C higher N with
                                        | None => higher
                                        | Some N' => paths_bound N' higher paths_from
                                        end)
              end)
      else None
  end.

Definition check_staged (target : Z) (stages : list stage) (paths_above : option Z) (paths_from : nat)
  (numerator denominator : Z) : bool :=
  match whole_bound target stages paths_above paths_from with
  | None => false
  | Some b => (0 <? denominator) && (b * denominator <=? numerator * precision M)
  end.

Lemma above_higher target stages higher paths_from N plan :
  staged_numbers_ok I C coarse = true -> target <= higher -> (paths_from <= horizon I)%nat -> is_plan I plan ->
  narrowed I C coarse memory advise mind target stages = Some N ->
  (J I plan * IZR (precision M)
   <= IZR (match close I C higher N with None => higher | Some N' => paths_bound N' higher paths_from end))%R.
Proof.
  intros Hok Hle Hfrom Hp EN.
  destruct (Rle_dec (J I plan * IZR (precision M)) (IZR higher)) as [L | G0].
  - eapply Rle_trans; [exact L|]. apply IZR_le.
    destruct (close _ _ _ N) as [N'|]; [|lia]. unfold paths_bound, most_of. cbv zeta.
    match goal with |- context [fold_left _ ?l0 higher] => generalize l0 as l end. intros l.
    assert (H : forall l b, b <= fold_left (fun b (jv : joint * Z) => Z.max b (snd jv)) l b).
    { induction l0 as [|x l0 IH]; intros b; simpl; [lia|]. specialize (IH (Z.max b (snd x))). lia. }
    apply H.
  - apply Rnot_le_lt in G0. assert (G1 : (IZR target < J I plan * IZR (precision M))%R) by (apply IZR_le in Hle; lra).
    destruct (narrowed_ok I C coarse memory advise mind plan Hok Hp target G1 stages) as [N0 [EN0 HN]].
    rewrite EN in EN0. injection EN0 as <-.
    destruct (close_ok I C coarse plan Hok Hp higher G0 N HN) as [N' [EN' HN']]. rewrite EN'.
    unfold paths_bound. destruct paths_from as [|from].
    + apply (paths_ok I C coarse memory advise mind N' higher (sweep_all I C N') _ plan Hok Hp G0 HN' eq_refl eq_refl).
    + apply (paths_through_ok I C coarse memory advise mind N' higher (sweep_all I C N') _ plan Hok Hp G0 HN' eq_refl eq_refl (S from) Hfrom).
Qed.

Lemma staged_bound_times target stages b plan :
  staged_bound I C coarse memory advise mind target stages = Some b -> is_plan I plan ->
  0 < precision M /\ (J I plan * IZR (precision M) <= IZR b)%R.
Proof.
  intros Hb Hp. pose proof Hb as Hb'. unfold staged_bound in Hb'. destruct (staged_numbers_ok I C coarse) eqn:Hok; [|discriminate].
  pose proof (precision_pos I C coarse Hok) as Zp. split; [exact Zp|]. pose proof (IZR_pos _ Zp) as Pp.
  pose proof (staged_bound_sound I C coarse memory advise mind target stages b plan Hb Hp) as H.
  apply (Rmult_le_compat_r (IZR (precision M))) in H; [|lra]. unfold Rdiv in H.
  rewrite Rmult_assoc, Rinv_l, Rmult_1_r in H by lra. exact H.
Qed.

Lemma whole_bound_sound target stages paths_above paths_from b plan :
  whole_bound target stages paths_above paths_from = Some b -> is_plan I plan ->
  0 < precision M /\ (J I plan * IZR (precision M) <= IZR b)%R.
Proof.
  unfold whole_bound. intros Hb Hp. destruct paths_above as [higher|]; [|apply (staged_bound_times target stages); assumption].
  destruct (staged_numbers_ok I C coarse) eqn:Hok; [|discriminate]. simpl in Hb.
  destruct (Z.leb_spec target higher) as [Hle | _]; [|discriminate]. simpl in Hb.
  destruct (Nat.leb_spec paths_from (horizon I)) as [Hfrom | _]; [|discriminate]. injection Hb as <-.
  pose proof (staged_bound_times target stages) as Hstages. unfold staged_bound in Hstages. rewrite Hok in Hstages.
  destruct (narrowed I C coarse memory advise mind target stages) as [N|] eqn:EN; [|exact (Hstages _ plan eq_refl Hp)].
  destruct (Hstages _ plan eq_refl Hp) as [Zp Hby]. split; [exact Zp|]. cbv zeta.
  destruct (bound_of I C target N <=? higher); [exact Hby|].
  pose proof (above_higher target stages higher paths_from N plan Hok Hle Hfrom Hp EN) as Hpaths.
  destruct (Z.min_spec (bound_of I C target N)
    (match close I C higher N with None => higher | Some N' => paths_bound N' higher paths_from end)) as [[_ ->] | [_ ->]]; assumption.
Qed.

(** A staged claim that passes the check is true. *)
Theorem staged_sound target stages paths_above paths_from numerator denominator plan :
  check_staged target stages paths_above paths_from numerator denominator = true -> is_plan I plan ->
  (J I plan <= IZR numerator / IZR denominator)%R.
Proof.
  unfold check_staged. intros H Hp. destruct (whole_bound target stages paths_above paths_from) as [b|] eqn:E; [|discriminate].
  destruct (whole_bound_sound target stages paths_above paths_from b plan E Hp) as [Zu HJ]. split_andb. to_Z.
  assert (Hle : b * denominator <= numerator * precision M) by assumption.
  assert (Hden : 0 < denominator) by assumption.
  apply IZR_le in Hle. rewrite !mult_IZR in Hle. apply IZR_pos in Zu, Hden.
  apply Rmult_le_reg_r with (IZR denominator * IZR (precision M))%R; [apply Rmult_lt_0_compat; assumption|].
  replace (IZR numerator / IZR denominator * (IZR denominator * IZR (precision M)))%R with (IZR numerator * IZR (precision M))%R by (field; lra).
  eapply Rle_trans; [|exact Hle].
  replace (J I plan * (IZR denominator * IZR (precision M)))%R with (J I plan * IZR (precision M) * IZR denominator)%R by ring.
  apply Rmult_le_compat_r; lra.
Qed.
End Whole.
