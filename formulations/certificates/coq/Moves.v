(** Moves of the team: from a joint state of a step to those of the next one, and what the two are worth
    at most together. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Permutation FMapPositive.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search Narrowing Joints Steps.
Import ListNotations.
Open Scope Z_scope.

Section Moves.
Variables (I : instance) (C : certificate) (coarse : Z).
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.
Notation T := (horizon I).
Notation M := (numbers C).

(** * Where the drones of a joint state may move *)

Definition moved (k : nat) (from : positive) (s : state) : named := ((k, place I k s), (from, s)).

Definition ways_meet (a b : named) : bool :=
  places_meet I a b
  || (let way (n : named) := let '((k, p), (from, _)) := n in (k, from, p) in
      clash I (way a) (way b) && clash I (way b) (way a)).

(** The states of each class that are left at a step and have a price. *)
Definition candidates_at (st : step) (gs : list group) (t : nat) (price_of : nat -> state -> option Z) : list (nat * PM.t candidate) :=
  map (fun k => let of_state := price_of k in
    (k, build_map (fun s (_ : Z) => match of_state s with
          | None => None
          | Some p => Some (candidate_of I coarse gs t k (moved k xH s) p (number_of (charges st) k s) (step_static st k s p) s)
          end) (map_of (u_prices (now st)) k))) (classes I).

Definition of_candidates (cs : list (nat * PM.t candidate)) (k : nat) : PM.t candidate := of_class (PM.empty _) cs k.

(** A candidate with the place a step before or after, and the reward of the move. *)
Definition with_move (n : named) (rewarded : Z) (c : candidate) : candidate :=
  Cand named n (amounts named c) (amounts_up named c) (price named c - rewarded) (charge named c)
    (match static named c with [] => [] | x :: xs => x :: map (fun x => x + rewarded) xs end).

Definition choice (mine : PM.t candidate) (k : nat) (next : positive) (rewarded : state -> Z) (s : state) : list candidate :=
  match PM.find s mine with None => [] | Some c => [with_move (moved k next s) (rewarded s) c] end.

(** For each drone of a joint state of step t, the states of the step after to which it can move. *)
Definition pools_in (cs : list (nat * PM.t candidate)) (rewarded : nat -> state -> state -> Z) (t : nat) (j : joint) : pool candidate :=
  map (fun ks => let (k, s) := ks : nat * state in
         (1%nat, flat_map (choice (of_candidates cs k) k (place I k s) (rewarded k s)) (moves I k t s))) j.

(** * The constant of a move *)

Notation search := (search I C coarse memory advise mind).
Notation highest := (highest I C coarse memory advise mind).

Definition take_above (st : step) (gs : list group) (threshold : Z) (l : list candidate) (m : joints) : joints :=
  let profit := profit_of I C st gs l in
  if enough st l (exact_of I C gs l) && (threshold <? profit) then insert (Ordered.sort (map taken l)) profit m else m.

(** The joint states of a step that have more profit than a threshold, with their profits. *)
Definition joints_above (st : step) (t : nat) (threshold : Z) : joints :=
  let gs := step_groups I C t in
  search (fun _ => threshold) (take_above st gs threshold) (places_meet I) gs st
    (class_pools I coarse st gs t (u_prices (now st))) (PM.empty _).

(** The most that two joint states between which the team can move are worth, one of step t and one of
    the step after, at the prices of now; or the constant that is claimed. *)
Definition move_constant (N : narrowing) (t : nat) (claim : Z) : Z :=
  let next := at_ N (S t) in
  let gs := step_groups I C (S t) in
  let cs := candidates_at next gs (S t) (fun k => let prices := map_of (u_prices (now next)) k in fun s => PM.find s prices) in
  fold_left (fun best jv => highest ways_meet gs next (snd jv) (pools_in cs (fun _ _ _ => 0) t (fst jv)) best)
            (listed (joints_above (at_ N t) t (claim - u_constant (now next)))) claim.

(** * Soundness *)

Lemma ways_meet_symmetric a b : ways_meet a b = ways_meet b a.
Proof.
  unfold ways_meet. rewrite places_meet_symmetric. f_equal. destruct a as [[k p] [q s]], b as [[k' p'] [q' s']].
  apply andb_comm.
Qed.

Variable plan : list flight.
Hypothesis ok : staged_numbers_ok I C coarse = true.
Hypothesis planned : is_plan I plan.
Notation FR := (FR I C plan).
Notation step_inv := (step_inv I C plan).
Notation flown := (flown_candidate I C coarse).
Notation class_in := (class_in I plan planned).

Lemma ways_fit (cf : flight -> candidate) t : (S t <= T)%nat ->
  (forall f, In f plan -> name named (cf f) = moved (fst f) (place I (fst f) (snd f t)) (snd f (S t))) ->
  fits_together named ways_meet (map cf plan).
Proof.
  intros Ht Hname. destruct planned as [_ H]. unfold fits_together. clear ok planned.
  induction H as [|f l Hf H IH]; simpl; [constructor|]. constructor; [|apply IH; intros; apply Hname; right; assumption].
  rewrite Forall_map. apply Forall_forall. intros g Hg. rewrite Forall_forall in Hf.
  rewrite (Hname f) by (left; reflexivity). rewrite (Hname g) by (right; exact Hg).
  unfold ways_meet, places_meet. simpl. destruct (Hf g Hg) as [Hm Hc]. rewrite (Hm (S t) Ht), (Hc t ltac:(lia)). reflexivity.
Qed.

Lemma choice_found st t price_of nm pr f (next : positive) (rewarded : state -> Z) p : In f plan -> step_inv t st ->
  price_of (fst f) (snd f t) = Some p -> nm f = moved (fst f) next (snd f t) -> pr f = p - rewarded (snd f t) ->
  In (flown st t nm pr f)
     (choice (of_candidates (candidates_at st (step_groups I C t) t price_of) (fst f)) (fst f) next rewarded (snd f t)).
Proof.
  intros Hf [HL _] Ep En Er. destruct (HL f Hf) as [v Ev]. unfold choice, of_candidates, candidates_at. cbv zeta.
  rewrite of_class_map by (apply class_in, Hf). erewrite find_build_map; [|exact Ev | rewrite Ep; reflexivity].
  left. unfold flown_candidate, with_move, candidate_of, step_static. cbn [amounts amounts_up price charge static].
  rewrite En, Er. f_equal. rewrite map_map. f_equal. apply map_ext. intros u. lia.
Qed.

(** The joint states to which a plan's can move include the plan's next one. *)
Lemma pools_in_ok st t price_of nm pr rewarded plan' : (S t <= T)%nat -> step_inv (S t) st -> Permutation plan plan' ->
  (forall f, In f plan -> nm f = moved (fst f) (place I (fst f) (snd f t)) (snd f (S t))
     /\ exists p, price_of (fst f) (snd f (S t)) = Some p /\ pr f = p - rewarded (fst f) (snd f t) (snd f (S t))) ->
  Forall2 (fun nl f => fst nl = 1%nat /\ (In f plan -> In (flown st (S t) nm pr f) (snd nl)))
    (pools_in (candidates_at st (step_groups I C (S t)) (S t) price_of) rewarded t (joint_of plan' t)) plan'.
Proof.
  intros Ht Hinv Hperm Hall.
  assert (Hflown : forall f, In f plan' -> In (snd f (S t)) (moves I (fst f) t (snd f t))).
  { intros f Hf. apply (Permutation_in f (Permutation_sym Hperm)) in Hf.
    destruct (of_plan I plan planned f Hf) as [starts [_ [_ [_ Hm]]]]. apply Hm. lia. }
  unfold joint_of, pools_in. rewrite map_map. clear Hperm.
  induction plan' as [|f fs IH]; cbn [map]; constructor; [|apply IH; intros; apply Hflown; right; assumption].
  cbn [fst snd]. split; [reflexivity|]. intros Hf. destruct (Hall f Hf) as [En [p [Ep Er]]].
  apply in_flat_map. exists (snd f (S t)). split; [apply Hflown; left; reflexivity|].
  apply choice_found with (p := p); assumption.
Qed.

Lemma joints_above_ok st t threshold : (t <= T)%nat -> step_inv t st ->
  (IZR threshold < FR t - IZR (prices_sum plan (u_prices (now st)) t))%R ->
  exists plan', Permutation plan plan'
    /\ recorded (joint_of plan' t) (FR t - IZR (prices_sum plan (u_prices (now st)) t)) (joints_above st t threshold).
Proof.
  intros Ht Hinv Habove. set (gs := step_groups I C t).
  set (pr := fun f : flight => number_of (u_prices (now st)) (fst f) (snd f t)).
  set (nm := fun f : flight => here I (fst f) (snd f t)). set (cf := flown st t nm pr).
  set (profit := profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of I C coarse gs)).
  set (P := fun (l : list candidate) (m : joints) => (IZR threshold < profit l)%R ->
    exists j, Permutation (map taken l) j /\ recorded j (profit l) m).
  pose proof (fits_pairs I plan planned cf t Ht (fun f _ => eq_refl)) as Hfits.
  assert (HP : P (map cf plan) (joints_above st t threshold)).
  { apply (classes_searched I C coarse memory advise mind plan ok planned st t (places_meet I) nm pr Ht Hinv
      (places_meet_symmetric I) Hfits (fun _ => threshold) (take_above st gs threshold) P).
    - intros l a _ H H'. fold gs in H. fold profit in H. lra.
    - intros l a Hc H. unfold take_above. cbv zeta.
      pose proof (counting_enough I C coarse ok st t (places_meet I) l Hc) as He. fold gs in He. rewrite He.
      pose proof (profit_of_ok I C coarse ok st t (places_meet I) l Hc) as Hp. fold gs in Hp. fold profit in Hp.
      assert (Hlt : threshold < profit_of I C st gs l) by (apply lt_IZR; lra). apply Z.ltb_lt in Hlt. rewrite Hlt. simpl.
      exists (Ordered.sort (map taken l)). split; [apply Ordered.Permuted_sort | apply insert_new, Hp].
    - intros l l' a H H'. destruct (H H') as [j [Ej Hj]]. exists j. split; [exact Ej|].
      unfold take_above. cbv zeta. destruct (_ && _); [apply insert_old|]; exact Hj.
    - intros l l' a Hp H H'.
      assert (E : profit l' = profit l).
      { unfold profit, profitR. rewrite <- (F_perm _ _ _ _ _ _ _ Hp), <- (sum_perm _ (price named) _ _ Hp). reflexivity. }
      rewrite E in *. destruct (H H') as [j [Ej Hj]]. exists j. split; [|exact Hj].
      eapply Permutation_trans; [apply Permutation_map, Permutation_sym, Hp | exact Ej].
    - intros f Hf. destruct Hinv as [HL _]. destruct (HL f Hf) as [p Ep]. apply in_map_iff. exists (snd f t, p).
      split; [|apply PM.elements_correct, Ep].
      assert (En : pr f = p) by (unfold pr, number_of; rewrite Ep; reflexivity). unfold cf, flown_candidate. rewrite En. reflexivity. }
  pose proof (flown_profit I C coarse plan ok planned st t nm pr Ht plan (Permutation_refl _)) as Eprofit.
  fold gs in Eprofit. fold profit cf in Eprofit. change (sumZ (map pr plan)) with (prices_sum plan (u_prices (now st)) t) in Eprofit.
  unfold P in HP. rewrite Eprofit in HP. destruct (HP Habove) as [j [Ej Hj]].
  assert (Ejoint : Permutation (joint_of plan t) j).
  { eapply Permutation_trans; [|exact Ej]. unfold joint_of. rewrite map_map. apply Permutation_refl. }
  destruct (reordered plan plan t j (Permutation_refl _) Ejoint) as [plan' [Hperm ->]]. exists plan'. auto.
Qed.

(** No plan above the target is worth more at two steps than the constant of the move between them. *)
Lemma move_constant_ok N t claim : inv I C plan N -> (t < T)%nat ->
  (FR t + FR (S t) <= IZR (move_constant N t claim + paid_now plan N t + paid_now plan N (S t)))%R.
Proof.
  intros HN Ht. set (next := at_ N (S t)). pose proof HN as [_ Hsteps].
  pose proof (step_at_most I C plan N (S t) HN ltac:(lia)) as Hnext. fold next in Hnext.
  unfold move_constant. cbv zeta. fold next. set (gs := step_groups I C (S t)). set (cs := candidates_at next gs (S t) _).
  set (go := fun best (jv : joint * Z) => highest ways_meet gs next (snd jv) (pools_in cs (fun _ _ _ => 0) t (fst jv)) best).
  change (fold_left _ ?l ?b) with (fold_left go l b).
  assert (Hkeep : forall c l b, (c <= IZR b)%R -> (c <= IZR (fold_left go l b))%R).
  { intros c. induction l as [|x l IH]; intros b Hb; simpl; [exact Hb|]. apply IH. unfold go.
    apply (highest_keeps I C coarse memory advise mind next (S t) ways_meet (snd x)), Hb. }
  rewrite !plus_IZR.
  destruct (Rle_dec (FR t - IZR (paid_now plan N t)) (IZR (claim - u_constant (now next)))) as [Hlow | Hhigh].
  - pose proof (Hkeep (IZR claim) (listed (joints_above (at_ N t) t (claim - u_constant (now next)))) claim (Rle_refl _)) as Hc.
    rewrite minus_IZR in Hlow. rewrite plus_IZR in Hnext. lra.
  - apply Rnot_le_lt in Hhigh.
    destruct (joints_above_ok (at_ N t) t (claim - u_constant (now next)) ltac:(lia) (Hsteps t ltac:(lia)) Hhigh) as [plan' [Hperm Hrec]].
    destruct (recorded_listed _ _ _ Hrec) as [v [Hin Hv]].
    change (prices_sum plan (u_prices (now (at_ N t))) t) with (paid_now plan N t) in Hv.
    enough (H : (IZR v + (FR (S t) - IZR (paid_now plan N (S t)))
        <= IZR (fold_left go (listed (joints_above (at_ N t) t (claim - u_constant (now next)))) claim))%R) by lra.
    revert Hin. generalize (listed (joints_above (at_ N t) t (claim - u_constant (now next)))) as l. generalize claim.
    intros b l. revert b. induction l as [|x l IH]; intros b Hin; [contradiction|]. simpl.
    destruct Hin as [-> | Hin]; [|apply IH, Hin]. apply Hkeep. unfold go. cbn [fst snd].
    set (nm := fun f : flight => moved (fst f) (place I (fst f) (snd f t)) (snd f (S t))).
    set (pr := fun f : flight => number_of (u_prices (now next)) (fst f) (snd f (S t))).
    change (paid_now plan N (S t)) with (sumZ (map pr plan)).
    apply (highest_of_drones I C coarse memory advise mind plan ok planned next (S t) ways_meet nm pr v) with (plan' := plan');
      [lia | apply Hsteps; lia | apply ways_meet_symmetric | apply (ways_fit _ t); [lia | reflexivity] | exact Hperm|].
    apply pools_in_ok; [lia | apply Hsteps; lia | exact Hperm|]. intros f Hf. split; [reflexivity|].
    destruct (Hsteps (S t) ltac:(lia)) as [HL _]. destruct (HL f Hf) as [p Ep]. exists p. split; [exact Ep|].
    unfold pr, number_of, next. rewrite Ep. lia.
Qed.
End Moves.
