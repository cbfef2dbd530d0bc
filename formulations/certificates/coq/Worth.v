(** J of a plan is at most what its drones are paid, step by step, and the constants. *)
From Coq Require Import ZArith List Bool Reals Lra Lia FinFun.
From CocapCheck Require Import Spec Sums Returns Prices.
Import ListNotations.
Open Scope Z_scope.

Section Worth.
Variables (I : instance) (M : multipliers).
Notation T := (horizon I).
Hypothesis positive_units : units_ok I M = true.
Hypothesis groups_are_ok : forallb (group_ok I M) (groups I) = true.

Lemma groups_nodup : NoDup (groups I).
Proof.
  unfold groups. apply Injective_map_NoDup; [|apply seq_NoDup].
  intros a b H. apply SuccNat2Pos.inj. exact H.
Qed.

Lemma group_is_ok g : In g (groups I) -> group_ok I M g = true.
Proof. rewrite forallb_forall in groups_are_ok. auto. Qed.

Lemma group_parts g : group_ok I M g = true ->
  0 <= weight I g /\ 0 <= kappa (prices M g) /\ is_return (return_by I g).
Proof.
  unfold group_ok. intros H. apply andb_true_iff in H; destruct H as [H Hc]. split_andb. to_Z.
  repeat split; try assumption. destruct (return_by I g); simpl; [exact Logic.I|].
  destruct (cuts (prices M g)); [|discriminate]. split_andb. to_Z. assumption.
Qed.

Lemma pay_zero g k s : group_ok I M g = true -> pay I M k s (g, 0) = 0.
Proof.
  intros Hg. unfold pay. rewrite root_of_0.
  replace (sumZ (map (cut_pay I M k s 0 0) (cuts (prices M g)))) with 0; [lia|].
  symmetry. apply sumZ_zero. intros c Hc. unfold cut_pay, cut_phi.
  destruct (phis c) as [l | knee sets] eqn:Ep; [|simpl; lia].
  assert (Hr : rising 0 (curve_in l k) = true).
  { assert (Hok : cut_ok I M g c = true).
    { unfold group_ok in Hg. apply andb_true_iff in Hg; destruct Hg as [_ Hg].
      destruct (return_by I g); [|destruct (cuts (prices M g)); [contradiction | discriminate]].
      apply andb_true_iff in Hg; destruct Hg as [Hg _]. apply andb_true_iff in Hg; destruct Hg as [_ Hg].
      rewrite forallb_forall in Hg. apply Hg, Hc. }
    unfold cut_ok in Hok. rewrite Ep in Hok. cbn [phis_ok] in Hok. split_andb.
    match goal with H : forallb _ l = true |- _ => rename H into HR end.
    clear - HR. induction l as [|[k' pts] cs IH]; [reflexivity|].
    simpl in HR. split_andb. simpl. destruct (Nat.eqb k k'); auto. }
  destruct (phi_0 (curve_in l k)) as [E | E]; [rewrite E; lia | congruence].
Qed.

(** * One state *)

Lemma increasing_tail v vs : increasing (v :: vs) = true ->
  increasing vs = true /\ Forall (fun w => (fst v < fst w)%positive) vs.
Proof.
  revert v. induction vs as [|w vs IH]; intros v H; [split; [reflexivity | constructor]|].
  cbn [increasing] in H. apply andb_true_iff in H. destruct H as [H1 H2]. apply Pos.ltb_lt in H1.
  split; [exact H2|]. constructor; [exact H1|]. destruct (IH w H2) as [_ F].
  rewrite Forall_forall in *. intros x Hx. specialize (F x Hx). lia.
Qed.

Definition amount_in (g : group) (vs : list (group * Z)) : Z :=
  sumZ (map snd (filter (fun v => Pos.eqb (fst v) g) vs)).

Lemma amount_in_none g vs : Forall (fun w => (g < fst w)%positive) vs -> amount_in g vs = 0.
Proof.
  unfold amount_in. induction 1 as [|w vs Hw H IH]; [reflexivity|]. simpl.
  destruct (Pos.eqb_spec (fst w) g); [lia|]. exact IH.
Qed.

Lemma pick_le (f : group -> Z) a ids : NoDup ids -> 0 <= f a ->
  sumZ (map (fun g => if Pos.eqb a g then f g else 0) ids) <= f a.
Proof.
  induction 1; simpl; intros Ha; [lia|].
  destruct (Pos.eqb_spec a x) as [-> | Hne].
  - rewrite sumZ_zero; [lia|]. intros y Hy. destruct (Pos.eqb_spec x y); [congruence | reflexivity].
  - specialize (IHNoDup Ha). lia.
Qed.

Lemma pays_in k s vs : increasing vs = true -> (forall v, In v vs -> 0 <= pay I M k s v) ->
  sumZ (map (fun g => pay I M k s (g, amount_in g vs)) (groups I)) <= sumZ (map (pay I M k s) vs).
Proof.
  induction vs as [|[a c] vs IH]; intros Hinc Hpay.
  - rewrite sumZ_zero; [simpl; lia|]. intros g Hg. unfold amount_in. simpl. apply pay_zero, group_is_ok, Hg.
  - destruct (increasing_tail _ _ Hinc) as [Hinc' Hlt]. simpl in Hlt.
    specialize (IH Hinc' (fun v Hv => Hpay v (or_intror Hv))).
    pose proof (pick_le (fun g => pay I M k s (g, c)) a (groups I) groups_nodup (Hpay _ (or_introl eq_refl))) as P.
    cbv beta in P.
    change (sumZ (map (pay I M k s) ((a, c) :: vs))) with (pay I M k s (a, c) + sumZ (map (pay I M k s) vs)).
    enough (sumZ (map (fun g => pay I M k s (g, amount_in g ((a, c) :: vs))) (groups I))
      = sumZ (map (fun g => if Pos.eqb a g then pay I M k s (g, c) else 0) (groups I))
        + sumZ (map (fun g => pay I M k s (g, amount_in g vs)) (groups I))) as E
      by (rewrite E; apply Z.add_le_mono; assumption).
    rewrite <- sumZ_add. apply sumZ_ext. intros g Hg. unfold amount_in at 1. cbn [filter fst].
    destruct (Pos.eqb_spec a g) as [-> | Hne].
    + cbn [map snd sumZ]. fold (amount_in g vs). rewrite (amount_in_none g vs Hlt), Z.add_0_r.
      rewrite (pay_zero g k s (group_is_ok g Hg)). symmetry. apply Z.add_0_r.
    + fold (amount_in g vs). symmetry. apply Z.add_0_l.
Qed.

Lemma views_ok_parts k t s : views_ok I M k t s = true ->
  (forall g, 0 <= amount I g k t s)
  /\ sumZ (map (fun g => pay I M k s (g, amount I g k t s)) (groups I)) <= sumZ (map (pay I M k s) (sees I k t s))
  /\ (over_time M = false -> forall g, at_step (prices M g) <> t -> amount I g k t s = 0).
Proof.
  unfold views_ok. intros H. apply andb_true_iff in H. destruct H as [Hinc H].
  rewrite forallb_forall in H. unfold view_ok in H. split; [|split].
  - intros g. unfold amount. apply sumZ_nonneg. intros v Hv. apply filter_In in Hv. destruct Hv as [Hv _].
    specialize (H v Hv). split_andb. to_Z. assumption.
  - apply (pays_in k s (sees I k t s) Hinc). intros v Hv. specialize (H v Hv). split_andb. to_Z. assumption.
  - intros Ho g Hg. unfold amount. apply sumZ_zero. intros v Hv. apply filter_In in Hv. destruct Hv as [Hv E].
    apply Pos.eqb_eq in E. specialize (H v Hv). apply andb_true_iff in H. destruct H as [_ H].
    rewrite Ho in H. exfalso. apply Hg. rewrite <- E. simpl in H. apply Nat.eqb_eq. exact H.
Qed.

Lemma paid_R k t s : (IZR (sumZ (map (pay I M k s) (sees I k t s))) / IZR (pay_unit I M)
                      <= IZR (paid I M k t s) / IZR (precision M))%R.
Proof.
  destruct (units I M positive_units) as [_ [Zu _]]. pose proof (pay_unit_pos I M positive_units) as Zp.
  unfold paid. pose proof (cdiv_R (precision M * sumZ (map (pay I M k s) (sees I k t s))) _ Zp) as H.
  rewrite mult_IZR in H. apply IZR_pos in Zu, Zp.
  apply Rmult_le_reg_r with (IZR (precision M)); [exact Zu|].
  unfold Rdiv at 2. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r. eapply Rle_trans; [|exact H].
  apply Req_le. field. lra.
Qed.

(** * Plans *)

Variable plan : list flight.
Hypothesis of_team : map fst plan = map fst (team I).
Hypothesis plan_apart : ForallOrdPairs (apart I) plan.
Hypothesis sights_ok : forall f t, In f plan -> (t <= T)%nat -> views_ok I M (fst f) t (snd f t) = true.

Definition seen_at (t : nat) (g : group) : Z := sumZ (map (fun f => amount I g (fst f) t (snd f t)) plan).
Definition paid_at (t : nat) : Z := sumZ (map (fun f => paid I M (fst f) t (snd f t)) plan).

(** What a plan sees is worth at a step. *)
Definition step_worth (t : nat) : R := sumR (map (fun g => worth I g (seen_at t g)) (groups I)).

(** The constants of the groups of a step, and of all. *)
Definition step_constant (t : nat) : Z :=
  sumZ (map (fun g => if Nat.eqb (at_step (prices M g)) t then kappa (prices M g) else 0) (groups I)).
Definition constants : Z := sumZ (map (fun g => kappa (prices M g)) (groups I)).

Lemma seen_total g : seen I plan g = total (S T) (fun t => seen_at t g).
Proof. unfold seen, seen_at. rewrite total_sum. reflexivity. Qed.

Lemma amounts_nonneg f t g : In f plan -> (t <= T)%nat -> 0 <= amount I g (fst f) t (snd f t).
Proof. intros Hf Ht. apply (views_ok_parts _ _ _ (sights_ok f t Hf Ht)). Qed.

Lemma worth_zero g : group_ok I M g = true -> worth I g 0 = 0%R.
Proof.
  intros Hg. destruct (group_parts g Hg) as [_ [_ Hr]]. unfold worth.
  unfold Rdiv at 2. rewrite Rmult_0_l, return_zero by exact Hr. ring.
Qed.

(** Where nothing adds up over time, the worth of a plan is that of its steps, or less. *)
Lemma worth_steps : (sumR (map (fun g => worth I g (seen I plan g)) (groups I))
                     <= sumR (map step_worth (seq 0 (S T))))%R.
Proof.
  unfold step_worth. rewrite sumR_swap. apply sumR_le. intros g Hg.
  destruct (group_parts g (group_is_ok g Hg)) as [Hw [_ Hr]].
  destruct (units I M positive_units) as [_ [_ [Za Zw]]].
  unfold worth. rewrite sumR_scale. apply Rmult_le_compat_l; [apply frac_nonneg; assumption|].
  rewrite seen_total, total_seq, IZR_sumZ.
  replace (sumR (map (fun t => IZR (seen_at t g)) (seq 0 (S T))) / IZR (amount_unit I))%R
    with (sumR (map (fun t => IZR (seen_at t g) / IZR (amount_unit I)) (seq 0 (S T))))%R.
  2:{ unfold Rdiv. rewrite (Rmult_comm (sumR _)), <- sumR_scale. apply sumR_ext. intros. ring. }
  rewrite <- (map_map (fun t => IZR (seen_at t g) / IZR (amount_unit I))%R (return_value (return_by I g))).
  apply return_sum; [exact Hr|]. apply Forall_forall. intros x Hx. apply in_map_iff in Hx.
  destruct Hx as [t [<- Ht]]. apply in_seq in Ht. apply frac_nonneg; [|exact Za].
  unfold seen_at. apply sumZ_nonneg. intros f Hf. apply amounts_nonneg; [exact Hf | lia].
Qed.

Lemma sum_fractions a b : (IZR a / IZR (precision M) + IZR b / IZR (precision M) = IZR (a + b) / IZR (precision M))%R.
Proof. rewrite plus_IZR. unfold Rdiv. ring. Qed.

Lemma paid_sum (l : list (nat * nat * state)) :
  (IZR (sumZ (map (fun x => let '(k, t, s) := x in sumZ (map (pay I M k s) (sees I k t s))) l)) / IZR (pay_unit I M)
   <= IZR (sumZ (map (fun x => let '(k, t, s) := x in paid I M k t s) l)) / IZR (precision M))%R.
Proof.
  induction l as [|[[k t] s] l IH]; simpl.
  - unfold Rdiv. rewrite !Rmult_0_l. lra.
  - rewrite !plus_IZR. unfold Rdiv in *. rewrite !Rmult_plus_distr_r.
    pose proof (paid_R k t s) as H. unfold Rdiv in H. lra.
Qed.

(** Groups together: views of some stations, each a drone at a step. *)
Lemma groups_bound (stations : list (nat * nat * state)) (gs : group -> bool) :
  (forall k t s, In (k, t, s) stations -> views_ok I M k t s = true) ->
  (over_time M = true
   \/ map (fun x => fst (fst x)) stations = map fst (team I)
      /\ ForallOrdPairs (fun x y => let '(k, _, s) := x in let '(k', _, s') := y in
           meet I (k, place I k s) (k', place I k' s') = false) stations
      /\ forall g, gs g = true -> forall k t s, In (k, t, s) stations -> t = at_step (prices M g)) ->
  (forall g, In g (groups I) -> gs g = false -> forall k t s, In (k, t, s) stations -> amount I g k t s = 0) ->
  (sumR (map (fun g => worth I g (sumZ (map (fun x => let '(k, t, s) := x in amount I g k t s) stations))) (groups I))
   <= IZR (sumZ (map (fun x => let '(k, t, s) := x in paid I M k t s) stations)
           + sumZ (map (fun g => if gs g then kappa (prices M g) else 0%Z) (groups I))) / IZR (precision M))%R.
Proof.
  intros Hv Ht Hgs. rewrite <- sum_fractions.
  pose proof (pay_unit_pos I M positive_units) as Zp. apply IZR_pos in Zp.
  set (vs := fun g => map (fun x => let '(k, t, s) := x in (k, s, amount I g k t s)) stations).
  apply Rle_trans with (sumR (map (fun g => IZR (sumZ (map (fun x => pay I M (class_at x) (state_at x) (g, snd x)) (vs g))) / IZR (pay_unit I M)
      + IZR (if gs g then kappa (prices M g) else 0%Z) / IZR (precision M)) (groups I)))%R.
  { apply sumR_le. intros g Hg. pose proof (group_is_ok g Hg) as Hok.
    replace (sumZ (map (fun x => let '(k, t, s) := x in amount I g k t s) stations)) with (sumZ (map snd (vs g))).
    2:{ unfold vs. rewrite map_map. apply sumZ_ext. intros [[k t] s] _. reflexivity. }
    destruct (gs g) eqn:Eg.
    - apply group_bound; try assumption.
      + intros x Hx. unfold vs in Hx. apply in_map_iff in Hx. destruct Hx as [[[k t] s] [<- Hx]]. simpl.
        apply (views_ok_parts k t s (Hv k t s Hx)).
      + destruct Ht as [Ho | [Ht [Hp Hs]]]; [left; exact Ho | right]. unfold vs. split; [|split].
        * rewrite <- Ht, map_map. apply map_ext. intros [[k t] s]. reflexivity.
        * apply map_pairs. apply (pairs_weaken _ _ _ Hp). intros [[k t] s] [[k' t'] s'] H. exact H.
        * intros x Hx. apply in_map_iff in Hx. destruct Hx as [[[k t] s] [<- Hx]].
          rewrite <- (Hs g Eg k t s Hx). reflexivity.
    - assert (E0 : forall x, In x (vs g) -> snd x = 0).
      { intros x Hx. unfold vs in Hx. apply in_map_iff in Hx. destruct Hx as [[[k t] s] [<- Hx]]. simpl.
        apply (Hgs g Hg Eg k t s Hx). }
      rewrite sumZ_zero by exact E0. rewrite worth_zero by exact Hok.
      rewrite sumZ_zero.
      2:{ intros x Hx. rewrite (E0 x Hx). apply pay_zero. exact Hok. }
      unfold Rdiv. rewrite !Rmult_0_l. lra. }
  rewrite sumR_add. apply Rplus_le_compat.
  - eapply Rle_trans; [|apply paid_sum].
    replace (sumR (map (fun g => IZR (sumZ (map (fun x => pay I M (class_at x) (state_at x) (g, snd x)) (vs g))) / IZR (pay_unit I M))%R (groups I)))
      with (IZR (sumZ (map (fun g => sumZ (map (fun x => pay I M (class_at x) (state_at x) (g, snd x)) (vs g))) (groups I))) / IZR (pay_unit I M))%R.
    2:{ rewrite IZR_sumZ. unfold Rdiv. rewrite Rmult_comm, <- sumR_scale. apply sumR_ext. intros. ring. }
    apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat, Zp|]. apply IZR_le.
    unfold vs.
    replace (sumZ (map (fun g => sumZ (map (fun x => pay I M (class_at x) (state_at x) (g, snd x))
               (map (fun x => let '(k, t, s) := x in (k, s, amount I g k t s)) stations))) (groups I)))
      with (sumZ (map (fun x => sumZ (map (fun g => let '(k, t, s) := x in pay I M k s (g, amount I g k t s)) (groups I))) stations)).
    2:{ rewrite sumZ_swap. apply sumZ_ext. intros g _. rewrite map_map. apply sumZ_ext. intros [[k t] s] _. reflexivity. }
    apply sumZ_le. intros [[k t] s] Hx. apply (views_ok_parts k t s (Hv k t s Hx)).
  - apply Req_le. rewrite IZR_sumZ. unfold Rdiv. rewrite (Rmult_comm (sumR _)), <- sumR_scale.
    apply sumR_ext. intros. ring.
Qed.

Lemma step_bound t : over_time M = false -> (t <= T)%nat ->
  (step_worth t <= IZR (paid_at t + step_constant t) / IZR (precision M))%R.
Proof.
  intros Ho Ht.
  pose proof (groups_bound (map (fun f => (fst f, t, snd f t)) plan) (fun g => Nat.eqb (at_step (prices M g)) t)) as H.
  unfold step_worth, paid_at, step_constant.
  replace (sumZ (map (fun f => paid I M (fst f) t (snd f t)) plan))
    with (sumZ (map (fun x => let '(k, t, s) := x in paid I M k t s) (map (fun f => (fst f, t, snd f t)) plan)))
    by (rewrite map_map; reflexivity).
  eapply Rle_trans; [|apply H].
  - apply Req_le. apply sumR_ext. intros g _. f_equal. unfold seen_at. rewrite map_map. reflexivity.
  - intros k t' s Hin. apply in_map_iff in Hin. destruct Hin as [f [E Hf]]. injection E as <- <- <-.
    apply sights_ok; assumption.
  - right. split; [|split].
    + rewrite map_map. simpl. exact of_team.
    + apply map_pairs. apply (pairs_weaken _ _ _ plan_apart). intros f g [Hm _]. exact (Hm t Ht).
    + intros g Eg k t' s Hin. apply in_map_iff in Hin. destruct Hin as [f [E Hf]]. injection E as <- <- <-.
      apply Nat.eqb_eq in Eg. symmetry. exact Eg.
  - intros g _ Eg k t' s Hin. apply in_map_iff in Hin. destruct Hin as [f [E Hf]]. injection E as <- <- <-.
    apply Nat.eqb_neq in Eg. apply (views_ok_parts _ _ _ (sights_ok f t Hf Ht)); assumption.
Qed.

Lemma step_constants_le : sumZ (map step_constant (seq 0 (S T))) <= constants.
Proof.
  unfold step_constant, constants. rewrite sumZ_swap. apply sumZ_le. intros g Hg.
  destruct (group_parts g (group_is_ok g Hg)) as [_ [Hk _]].
  rewrite <- (total_seq (S T) (fun t => if Nat.eqb (at_step (prices M g)) t then kappa (prices M g) else 0)).
  rewrite (total_pick _ _ (fun _ => kappa (prices M g))). destruct (Nat.ltb _ _); lia.
Qed.

(** The worth of all that is seen. *)
Lemma worth_bound : (sumR (map (fun g => worth I g (seen I plan g)) (groups I))
  <= IZR (sumZ (map (fun f => total (S T) (fun t => paid I M (fst f) t (snd f t))) plan) + constants) / IZR (precision M))%R.
Proof.
  destruct (units I M positive_units) as [_ [Zu _]]. apply IZR_pos in Zu.
  destruct (over_time M) eqn:Eo.
  - set (stations := flat_map (fun f => map (fun t => (fst f, t, snd f t)) (seq 0 (S T))) plan).
    assert (Es : forall h : nat -> nat -> state -> Z,
       sumZ (map (fun x => let '(k, t, s) := x in h k t s) stations)
       = sumZ (map (fun f => total (S T) (fun t => h (fst f) t (snd f t))) plan)).
    { intros h. unfold stations. rewrite sumZ_flat_map. apply sumZ_ext. intros f _.
      rewrite map_map, total_seq. reflexivity. }
    pose proof (groups_bound stations (fun _ => true)) as H.
    rewrite (Es (paid I M)) in H. unfold constants. eapply Rle_trans; [|apply H].
    + apply Req_le, sumR_ext. intros g _. f_equal. rewrite (Es (amount I g)). reflexivity.
    + intros k t s Hin. unfold stations in Hin. apply in_flat_map in Hin. destruct Hin as [f [Hf Hin]].
      apply in_map_iff in Hin. destruct Hin as [t' [E Ht]]. injection E as <- <- <-. apply in_seq in Ht.
      apply sights_ok; [exact Hf | lia].
    + left. exact Eo.
    + discriminate.
  - eapply Rle_trans; [apply worth_steps|].
    eapply Rle_trans; [apply (sumR_le _ (fun t => IZR (paid_at t + step_constant t) / IZR (precision M))%R)|].
    + intros t Ht. apply in_seq in Ht. apply step_bound; [exact Eo | lia].
    + replace (sumR (map (fun t => IZR (paid_at t + step_constant t) / IZR (precision M))%R (seq 0 (S T))))
        with (IZR (sumZ (map (fun t => paid_at t + step_constant t)%Z (seq 0 (S T)))) / IZR (precision M))%R.
      2:{ rewrite IZR_sumZ. unfold Rdiv. rewrite Rmult_comm, <- sumR_scale. apply sumR_ext. intros. ring. }
      apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat, Zu|]. apply IZR_le.
      rewrite sumZ_add. apply Z.add_le_mono; [|apply step_constants_le].
      unfold paid_at. rewrite sumZ_swap. apply Z.eq_le_incl, sumZ_ext. intros f _. rewrite total_seq. reflexivity.
Qed.

End Worth.
