(** A step and its joint states: what they are worth at most, and a search that leaves out none that
    a plan may visit. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation FMapPositive Sorting.Mergesort Orders.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search Narrowing Joints.
Import ListNotations.
Open Scope Z_scope.

(** Class and place; the place a step before, where it matters, and the state. *)
Definition named : Type := (nat * positive) * (positive * state).
Notation candidate := (cand named).

(** Candidates of most profit first: an order, and nothing more. *)
Module ByProfit <: TotalLeBool.
  Definition t : Type := candidate * Z.
  Definition leb (a b : t) : bool := profit_gain named b <=? profit_gain named a.
  Lemma leb_total a b : leb a b = true \/ leb b a = true.
  Proof. unfold leb. destruct (Z.leb_spec (profit_gain named b) (profit_gain named a)); [auto|]. right. apply Z.leb_le. lia. Qed.
End ByProfit.
Module Sorted := Sort ByProfit.

Section Steps.
Variables (I : instance) (C : certificate) (coarse : Z).

(** Who gives advice at a node of a search, and what it thinks at first. *)
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.

Notation T := (horizon I).
Notation M := (numbers C).

(** * Candidates, and what joint states are worth *)

Definition step_groups (t : nat) : list group :=
  filter (fun g => Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) (groups I).

Definition specs_of (gs : list group) : list spec :=
  map (fun g => spec_of (weight_unit I) (precision M) coarse (weight I g) (return_by I g)) gs.

Definition places_meet (a : named) : named -> bool :=
  let x := fst a in let meet_x := meet I x in
  fun b => let y := fst b in meet_x y && meet I y x.

Definition candidate_of (gs : list group) (t k : nat) (n : named) (price charge : Z) (static : list Z) (s : state) : candidate :=
  let zs := map (fun g => amount I g k t s) gs in
  Cand named n zs (map (coarse_up (amount_unit I) coarse) zs) price charge static.

(** The worth of amounts, in 1/precision, rounded up: the exact one. *)
Definition exact_return (w : Z) (r : return_of) (z : Z) : Z :=
  match r with
  | Root => cdiv (precision M * (w * root_of I M z)) (weight_unit I * scale M)
  | AtMost k => cdiv (precision M * (w * Z.min z (k * amount_unit I))) (weight_unit I * amount_unit I)
  end.

Fixpoint add_all (l : list (list Z)) (n : nat) : list Z :=
  match n with
  | O => []
  | S n' => sumZ (map (fun zs => hd 0 zs) l) :: add_all (map (fun zs => tl zs) l) n'
  end.

Fixpoint exact_worth (gs : list group) (zs : list Z) : Z :=
  match gs, zs with
  | g :: gs', z :: zs' => exact_return (weight I g) (return_by I g) z + exact_worth gs' zs'
  | _, _ => 0
  end.

Definition exact_of (gs : list group) (l : list candidate) : Z :=
  exact_worth gs (add_all (map (amounts named) l) (length gs)).

(** The least of a number and of what a joint state is worth at most by bounds of its profit. *)
Fixpoint least_static (j : nat) (bases : list base) (l : list candidate) (b : Z) : Z :=
  match bases with
  | [] => b
  | (is_limit, c) :: rest =>
      least_static (S j) rest l (if is_limit : bool then b else Z.min b (c + static_sum named j l))
  end.

Definition step_bases (st : step) : list base :=
  (true, u_constant (now st) - floor st) :: map (fun u => (false, u_constant u)) (now st :: earlier st).

Definition step_static (st : step) (k : nat) (s : state) (price : Z) : list Z :=
  (number_of (u_prices (now st)) k s - number_of (charges st) k s)
  :: map (fun u => number_of (u_prices u) k s - price) (now st :: earlier st).

Definition here (k : nat) (s : state) : named := let p := place I k s in ((k, p), (p, s)).

Definition step_candidate (st : step) (gs : list group) (t k : nat) (s : state) (price : Z) : candidate :=
  candidate_of gs t k (here k s) price (number_of (charges st) k s) (step_static st k s price) s.

(** Of each class, its number of drones, and its states that are listed with prices. *)
Definition class_pools (st : step) (gs : list group) (t : nat) (prices : by_state) : pool candidate :=
  map (fun k => (size I k, map (fun sv => step_candidate st gs t k (fst sv) (snd sv)) (PM.elements (map_of prices k))))
      (classes I).

(** What a joint state is known by: of each candidate its class and state. *)
Definition state_in (c : candidate) : state := snd (snd (name named c)).
Definition class_of (c : candidate) : nat := fst (fst (name named c)).
Definition taken (c : candidate) : nat * state := (class_of c, state_in c).

(** * The search of a step *)

(** True if it is worth enough to count. *)
Definition enough (st : step) (l : list candidate) (worth : Z) : bool := floor st + sum named (charge named) l <=? worth.

(** The profit of a joint state at most, by its worth and by the bounds of the step. *)
Definition profit_of (st : step) (gs : list group) (l : list candidate) : Z :=
  least_static 0 (step_bases st) l (exact_of gs l - sum named (price named) l).

(** Hands all joint states that count and have more profit than a threshold to a function. *)
Definition search {A : Type} (threshold : A -> Z) (take_down : list candidate -> A -> A)
    (conflict : named -> named -> bool) (gs : list group) (st : step) (p : pool candidate) (found : A) : A :=
  node named conflict coarse (specs_of gs) A threshold take_down Sorted.sort memory (advise (specs_of gs))
    (length (team I)) [] (nothing (specs_of gs)) 0 (- floor st) (step_bases st) p mind found.

(** The best so far, or a joint state's profit and what is known besides, if that is more. *)
Definition raised (st : step) (gs : list group) (known : Z) (l : list candidate) (best : Z) : Z :=
  if enough st l (exact_of gs l) then Z.max best (known + profit_of st gs l) else best.

(** The same of all joint states that count; at first, the best is what is claimed. *)
Definition highest (conflict : named -> named -> bool) (gs : list group) (st : step) (known : Z) (p : pool candidate)
  (claim : Z) : Z :=
  search (fun best => best - known) (raised st gs known) conflict gs st p claim.

(** * Soundness *)

(** ** A search's parts *)

Lemma places_meet_symmetric a b : places_meet a b = places_meet b a.
Proof. unfold places_meet. cbv zeta. apply andb_comm. Qed.

Lemma named_dec (a b : named) : {a = b} + {a <> b}.
Proof. unfold named in *. repeat decide equality. Qed.

Lemma sorted_permutes l : Permutation (Sorted.sort l) l.
Proof. apply Permutation_sym, Sorted.Permuted_sort. Qed.

Section Parts.
Hypothesis fine : units_ok I M = true.

Lemma exact_return_ok w r z : 0 <= w -> 0 <= z ->
  (IZR (precision M) * (IZR w / IZR (weight_unit I) * return_value r (IZR z / IZR (amount_unit I)))
   <= IZR (exact_return w r z))%R.
Proof.
  intros Hw Hz. destruct (units I M fine) as [Zs [Zu [Za Zw]]].
  pose proof (IZR_pos _ Zs) as Ps. pose proof (IZR_pos _ Zu) as Pu. pose proof (IZR_pos _ Za) as Pa. pose proof (IZR_pos _ Zw) as Pw.
  pose proof (IZR_nonneg _ Hw) as Hw'.
  assert (HW : (0 <= IZR (precision M) * IZR w / IZR (weight_unit I))%R).
  { apply Rmult_le_pos; [apply Rmult_le_pos; lra | apply Rlt_le, Rinv_0_lt_compat, Pw]. }
  destruct r as [|k]; simpl.
  - eapply Rle_trans; [|apply cdiv_R; nia]. rewrite !mult_IZR.
    destruct (root_of_ok I M fine z Hz) as [_ H].
    apply (Rmult_le_compat_l _ _ _ HW) in H.
    apply Rmult_le_reg_r with (IZR (scale M)); [exact Ps|].
    replace (IZR (precision M) * (IZR w * IZR (root_of I M z)) / (IZR (weight_unit I) * IZR (scale M)) * IZR (scale M))%R
      with (IZR (precision M) * IZR w / IZR (weight_unit I) * IZR (root_of I M z))%R by (field; lra).
    eapply Rle_trans; [|exact H]. apply Req_le. field. lra.
  - eapply Rle_trans; [|apply cdiv_R; nia]. rewrite !mult_IZR.
    assert (E : (Rmin (IZR z / IZR (amount_unit I)) (IZR k) <= IZR (Z.min z (k * amount_unit I)) / IZR (amount_unit I))%R).
    { apply Rmult_le_reg_r with (IZR (amount_unit I)); [exact Pa|].
      unfold Rdiv at 2. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
      unfold Rmin. destruct (Rle_dec (IZR z / IZR (amount_unit I)) (IZR k)) as [L | L].
      - apply (Rmult_le_compat_r (IZR (amount_unit I))) in L; [|lra].
        unfold Rdiv in *. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in * by lra.
        rewrite <- mult_IZR in L. apply le_IZR in L. apply IZR_le. lia.
      - apply Rnot_le_lt in L. apply (Rmult_lt_compat_r (IZR (amount_unit I))) in L; [|lra].
        unfold Rdiv in L. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in L by lra.
        rewrite <- mult_IZR in *. apply lt_IZR in L. apply IZR_le. lia. }
    apply (Rmult_le_compat_l _ _ _ HW) in E. eapply Rle_trans; [eapply Rle_trans; [|exact E]|]; apply Req_le; field; repeat split; lra.
Qed.

Definition gs_ok (gs : list group) : Prop := forall g, In g gs -> 0 <= weight I g /\ is_return (return_by I g).

Lemma specs_of_ok gs : gs_ok gs -> forall s, In s (specs_of gs) ->
  exists w r, s = spec_of (weight_unit I) (precision M) coarse w r /\ 0 <= w /\ is_return r.
Proof.
  intros H s Hs. apply in_map_iff in Hs. destruct Hs as [g [<- Hg]]. destruct (H g Hg).
  exists (weight I g), (return_by I g). auto.
Qed.

Lemma exact_worth_ok gs : gs_ok gs -> forall ls, (forall zs, In zs ls -> Forall (fun z => 0 <= z) zs) ->
  (worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth j zs 0%Z) ls))
   <= IZR (exact_worth gs (add_all ls (length gs))))%R.
Proof.
  induction gs as [|g gs IH]; intros Hg ls Hls; simpl; [lra|].
  rewrite plus_IZR. apply Rplus_le_compat.
  - replace (sumZ (map (fun zs => nth 0 zs 0) ls)) with (sumZ (map (fun zs => hd 0 zs) ls)).
    2:{ apply sumZ_ext. intros zs _. destruct zs; reflexivity. }
    apply exact_return_ok; [exact (proj1 (Hg g (or_introl eq_refl)))|]. apply sumZ_nonneg. intros zs Hzs. specialize (Hls zs Hzs).
    destruct Hls; simpl; lia.
  - assert (E : worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth (S j) zs 0) ls))
       = worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth j zs 0) (map (fun zs => tl zs) ls)))).
    { apply worth_ext. intros j. rewrite map_map. apply sumZ_ext. intros zs _. destruct zs; [destruct j|]; reflexivity. }
    rewrite E. apply IH; [intros g' Hg'; exact (Hg g' (or_intror Hg'))|].
    intros zs Hzs. apply in_map_iff in Hzs. destruct Hzs as [zs' [<- Hzs']]. specialize (Hls zs' Hzs').
    destruct Hls; simpl; [constructor | assumption].
Qed.

Notation all_ok gs := (Forall (cand_ok named (amount_unit I) coarse (specs_of gs))).
Notation worth_in gs := (F named (amount_unit I) (weight_unit I) (precision M) (specs_of gs)).

Lemma exact_of_ok gs l : gs_ok gs -> all_ok gs l -> (worth_in gs l <= IZR (exact_of gs l))%R.
Proof.
  intros Hg Hl. unfold F, exact_of.
  eapply Rle_trans; [|apply (exact_worth_ok gs Hg)].
  - apply Req_le, worth_ext. intros j. unfold together. rewrite map_map. reflexivity.
  - intros zs Hzs. apply in_map_iff in Hzs. destruct Hzs as [c [<- Hc]]. rewrite Forall_forall in Hl.
    destruct (Hl c Hc) as [_ [H _]]. exact H.
Qed.

Lemma least_static_ok l (p : R) bases : forall j b,
  (forall i is_limit c, nth_error bases i = Some (is_limit, c) ->
     if is_limit : bool then 0 <= c + static_sum named (j + i) l else (p <= IZR (c + static_sum named (j + i) l))%R) ->
  (p <= IZR b)%R -> (p <= IZR (least_static j bases l b))%R.
Proof.
  induction bases as [|[il c] bases IH]; intros j b Hall Hb; [exact Hb|]. cbn [least_static]. apply IH.
  - intros i il' c' Hi. specialize (Hall (S i) il' c' Hi). rewrite Nat.add_succ_r in Hall. exact Hall.
  - specialize (Hall O il c eq_refl). rewrite Nat.add_0_r in Hall. destruct il; [exact Hb|].
    destruct (Z.min_spec b (c + static_sum named j l)) as [[_ ->] | [_ ->]]; assumption.
Qed.

(** What candidates see together is worth what their groups are. *)
Lemma worth_of_groups {B} gs (a : group -> B -> Z) (l : list B) :
  (worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun b => nth j (map (fun g => a g b) gs) 0%Z) l))
   = sumR (map (fun g => IZR (precision M) * worth I g (sumZ (map (a g) l))) gs))%R.
Proof.
  induction gs as [|g gs IH]; simpl; [reflexivity|]. f_equal. exact IH.
Qed.
End Parts.

(** ** The drones of a plan, class by class *)

Lemma by_class_permutes {B} (class : B -> nat) (ks : list nat) (l : list B) : NoDup ks -> (forall b, In b l -> In (class b) ks) ->
  Permutation (concat (map (fun k => filter (fun b => Nat.eqb k (class b)) l) ks)) l.
Proof.
  intros Hk. induction l as [|b l IH]; intros Hin.
  - clear. induction ks; simpl; [constructor | assumption].
  - assert (Hb : In (class b) ks) by (apply Hin; left; reflexivity).
    destruct (in_split _ _ Hb) as [k1 [k2 Ek]].
    assert (Hnot : ~ In (class b) (k1 ++ k2)) by (rewrite Ek in Hk; apply NoDup_remove_2 in Hk; exact Hk).
    assert (Hother : forall k, In k (k1 ++ k2) -> filter (fun b' => Nat.eqb k (class b')) (b :: l) = filter (fun b' => Nat.eqb k (class b')) l).
    { intros k Hk'. simpl. destruct (Nat.eqb_spec k (class b)); [subst; contradiction | reflexivity]. }
    specialize (IH (fun b' Hb' => Hin b' (or_intror Hb'))). rewrite Ek in IH |- *. rewrite !map_app, !concat_app in *. simpl in *.
    rewrite Nat.eqb_refl.
    rewrite (map_ext_in _ (fun k => filter (fun b' => Nat.eqb k (class b')) l) k1) by (intros k Hk'; apply Hother, in_app_iff; auto).
    rewrite (map_ext_in _ (fun k => filter (fun b' => Nat.eqb k (class b')) l) k2) by (intros k Hk'; apply Hother, in_app_iff; auto).
    simpl. rewrite <- Permutation_middle. constructor. exact IH.
Qed.

Section Plan.
Variable plan : list flight.
Hypothesis ok : staged_numbers_ok I C coarse = true.
Hypothesis planned : is_plan I plan.
Notation staged_parts := (staged_parts I C coarse ok).
Notation units_fine := (units_fine I C coarse ok).
Notation groups_fine := (groups_fine I C coarse ok).
Notation precision_pos := (precision_pos I C coarse ok).
Notation class_in := (class_in I plan planned).
Notation views_fine := (views_fine I C coarse plan ok planned).
Notation FR := (FR I C plan).
Notation prices_sum := (prices_sum plan).
Notation step_inv := (step_inv I C plan).

(** ** A plan's joint states *)

(** Where the drones of a plan are, in this order. *)
Definition joint_of (fs : list flight) (t : nat) : joint := map (fun f => (fst f, snd f t)) fs.

(** What is in another order is the plan's joint state, its drones in another order. *)
Lemma reordered plan' t j : Permutation plan plan' -> Permutation (joint_of plan' t) j ->
  exists plan'', Permutation plan plan'' /\ j = joint_of plan'' t.
Proof.
  intros Hperm Hj. destruct (Permutation_map_inv (fun f : flight => (fst f, snd f t)) plan' (Permutation_sym Hj)) as [plan'' [E Hperm']].
  exists plan''. split; [eapply Permutation_trans; eassumption | exact E].
Qed.

Lemma step_groups_ok t : gs_ok (step_groups t).
Proof.
  intros g Hg. unfold step_groups in Hg. apply filter_In in Hg. destruct Hg as [Hg _].
  destruct (group_parts I M g (group_is_ok I M groups_fine g Hg)) as [H1 [_ H2]]. auto.
Qed.

Lemma step_worth_groups t : (t <= T)%nat ->
  (sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g)) (step_groups t)) = FR t)%R.
Proof.
  intros Ht. unfold FR, step_worth. rewrite <- sumR_scale. unfold step_groups.
  assert (H : forall gs, (forall g, In g gs -> In g (groups I)) ->
    (sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g))
       (filter (fun g => Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) gs))
     = sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g)) gs))%R).
  { induction gs as [|g gs IH]; intros Hgs; [reflexivity|]. specialize (IH (fun g' Hg' => Hgs g' (or_intror Hg'))).
    simpl. destruct (Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) eqn:E; simpl; rewrite IH; [reflexivity|].
    pose proof (group_is_ok I M groups_fine g (Hgs g (or_introl eq_refl))) as Hok.
    destruct (group_parts I M g Hok) as [Hw [_ Hr]].
    enough (E0 : worth I g (seen_at I plan t g) = 0%R) by (rewrite E0; lra).
    apply andb_false_iff in E. destruct E as [E | E].
    - apply Nat.eqb_neq in E.
      replace (seen_at I plan t g) with 0; [apply (worth_zero I M g Hok)|]. symmetry. unfold seen_at. apply sumZ_zero.
      intros f Hf. destruct staged_parts as [_ [Ho _]].
      apply (views_ok_parts I M groups_fine (fst f) t (snd f t) (views_fine f t Hf Ht)); assumption.
    - apply Z.ltb_ge in E. assert (W0 : weight I g = 0) by lia. unfold worth. rewrite W0. unfold Rdiv. rewrite !Rmult_0_l. reflexivity. }
  apply H. auto.
Qed.

Lemma team_size : length plan = length (team I).
Proof. destruct planned as [H _]. symmetry. apply (Forall2_lengths _ _ _ H). Qed.

Lemma classes_of_plan : map fst plan = map fst (team I).
Proof. apply (team_classes I plan planned). Qed.

Lemma fits_pairs (cf : flight -> candidate) t : (t <= T)%nat ->
  (forall f, In f plan -> name named (cf f) = here (fst f) (snd f t)) ->
  fits_together named places_meet (map cf plan).
Proof.
  intros Ht Hname. destruct planned as [_ H]. unfold fits_together. clear ok planned.
  induction H as [|f l Hf H IH]; simpl; [constructor|]. constructor; [|apply IH; intros; apply Hname; right; assumption].
  rewrite Forall_map. apply Forall_forall. intros g Hg. rewrite Forall_forall in Hf.
  rewrite (Hname f) by (left; reflexivity). rewrite (Hname g) by (right; exact Hg).
  unfold places_meet, here. simpl. destruct (Hf g Hg) as [Hm _]. rewrite (Hm t Ht). reflexivity.
Qed.

(** The drones' states at a step, with any prices, are a joint state that counts. *)
Definition flown_candidate (st : step) (t : nat) (nm : flight -> named) (pr : flight -> Z) (f : flight) : candidate :=
  candidate_of (step_groups t) t (fst f) (nm f) (pr f) (number_of (charges st) (fst f) (snd f t))
    (step_static st (fst f) (snd f t) (pr f)) (snd f t).

Lemma flown_candidates_ok st t nm pr : (t <= T)%nat ->
  Forall (cand_ok named (amount_unit I) coarse (specs_of (step_groups t))) (map (flown_candidate st t nm pr) plan).
Proof.
  intros Ht. apply Forall_forall. intros c Hc. apply in_map_iff in Hc. destruct Hc as [f [<- Hf]]. split; [|split].
  - simpl. unfold specs_of. rewrite !map_length. reflexivity.
  - simpl. apply Forall_forall. intros z Hz. apply in_map_iff in Hz. destruct Hz as [g [<- Hg]].
    apply (views_ok_parts I M groups_fine _ _ _ (views_fine f t Hf Ht)).
  - reflexivity.
Qed.

Lemma flown_worth st t nm pr : (t <= T)%nat ->
  F named (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) (map (flown_candidate st t nm pr) plan) = FR t.
Proof.
  intros Ht. rewrite <- (step_worth_groups t Ht). unfold F.
  set (amt := fun g (f : flight) => amount I g (fst f) t (snd f t)).
  rewrite (worth_ext _ _ _ _ _ (fun j => sumZ (map (fun f => nth j (map (fun g => amt g f) (step_groups t)) 0) plan))).
  - rewrite (worth_of_groups (step_groups t) amt plan). reflexivity.
  - intros j. unfold together. rewrite map_map. reflexivity.
Qed.

Lemma flown_counts conflict st t nm pr : (t <= T)%nat -> step_inv t st ->
  fits_together named conflict (map (flown_candidate st t nm pr) plan) ->
  counts named conflict (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) (step_bases st) (floor st)
    (map (flown_candidate st t nm pr) plan).
Proof.
  intros Ht [HL [HU HF]] Hfits. set (cf := flown_candidate st t nm pr) in *.
  pose proof (flown_worth st t nm pr Ht) as HFL. fold cf in HFL.
  assert (Hprice : sum named (price named) (map cf plan) = sumZ (map pr plan)).
  { unfold sum. rewrite map_map. reflexivity. }
  assert (Hcharge : sum named (charge named) (map cf plan) = prices_sum (charges st) t).
  { unfold sum, prices_sum. rewrite map_map. reflexivity. }
  split; [|split; [|exact Hfits]].
  - intros j il b Hj. unfold step_bases in Hj. destruct j as [|j]; simpl in Hj.
    + injection Hj as <- <-. pose proof (HU (now st) (or_introl eq_refl)) as Hn.
      assert (Es : static_sum named 0 (map cf plan) = prices_sum (u_prices (now st)) t - prices_sum (charges st) t).
      { unfold static_sum, prices_sum. rewrite map_map. simpl. clear. induction plan as [|f l IH]; simpl; lia. }
      rewrite Es. apply le_IZR. rewrite ?plus_IZR, ?minus_IZR in *. simpl. lra.
    + assert (Hj' : nth_error (map (fun u => (false, u_constant u)) (now st :: earlier st)) j = Some (il, b)) by exact Hj.
      rewrite nth_error_map in Hj'. destruct (nth_error (now st :: earlier st) j) as [u|] eqn:Eu; [|discriminate].
      simpl in Hj'. injection Hj' as <- <-. apply nth_error_In in Eu as Hu.
      assert (Es : static_sum named (S j) (map cf plan) = prices_sum (u_prices u) t - sumZ (map pr plan)).
      { unfold static_sum, prices_sum. rewrite map_map.
        assert (E : forall f, nth (S j) (static named (cf f)) 0 = number_of (u_prices u) (fst f) (snd f t) - pr f).
        { intros f. unfold cf, flown_candidate, candidate_of, step_static. cbn [static nth].
          rewrite (nth_indep _ 0 (number_of (u_prices u) (fst f) (snd f t) - pr f)).
          - rewrite (map_nth (fun u0 => number_of (u_prices u0) (fst f) (snd f t) - pr f) (now st :: earlier st) u).
            rewrite (nth_error_nth _ _ _ Eu). reflexivity.
          - rewrite map_length. apply nth_error_Some. congruence. }
        rewrite (map_ext _ _ E). clear. induction plan as [|f l IH]; cbn [map sumZ]; lia. }
      rewrite Es. unfold profitR. rewrite HFL, Hprice. pose proof (HU u Hu) as Hn.
      rewrite ?plus_IZR, ?minus_IZR in *. lra.
  - rewrite HFL, Hcharge. rewrite plus_IZR in HF. exact HF.
Qed.

Lemma worth_of_none t : F named (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) [] = 0%R.
Proof.
  unfold F. rewrite (worth_ext _ _ _ _ _ (fun j => sumZ (map (fun f : flight => nth j (map (fun g => (fun _ _ => 0) g f) (step_groups t)) 0) []))) by reflexivity.
  rewrite (worth_of_groups (step_groups t) (fun _ _ => 0) []). simpl. apply sumR_zero. intros g Hg. unfold worth.
  destruct (step_groups_ok t g Hg) as [_ Hr]. unfold Rdiv at 2. rewrite Rmult_0_l, return_zero by exact Hr. ring.
Qed.

(** The drones of a plan, class by class. *)
Definition by_classes {B} (cf : flight -> B) : list (list B) :=
  map (fun k => map cf (filter (fun f : flight => Nat.eqb k (fst f)) plan)) (classes I).

Lemma by_classes_permutes {B} (cf : flight -> B) : Permutation (concat (by_classes cf)) (map cf plan).
Proof.
  unfold by_classes. rewrite <- (map_map (fun k => filter (fun f : flight => Nat.eqb k (fst f)) plan) (map cf)), <- concat_map.
  apply Permutation_map. apply by_class_permutes; [apply NoDup_nodup | apply class_in].
Qed.

Lemma class_pools_ok {B} (cf : flight -> B) (choices : nat -> list B) :
  (forall f, In f plan -> In (cf f) (choices (fst f))) ->
  let p := map (fun k => (size I k, choices k)) (classes I) in
  completes p (by_classes cf) /\ positive_counts p /\ (drones_left p <= length (team I))%nat.
Proof.
  intros Hchoices p.
  assert (Hpool : completes p (by_classes cf)).
  { unfold p, by_classes. induction (classes I) as [|k ks IH]; simpl; constructor; [|exact IH]. simpl. split.
    - rewrite map_length. unfold size.
      assert (E : forall B (m : list (nat * B)), length (filter (fun x => Nat.eqb k (fst x)) m) = length (filter (Nat.eqb k) (map fst m))).
      { clear. intros B m. induction m as [|x m IH]; simpl; [reflexivity|]. destruct (Nat.eqb k (fst x)); simpl; congruence. }
      pose proof (E _ (team I)) as E2. rewrite <- classes_of_plan in E2. rewrite E2. exact (E _ plan).
    - intros c Hc. apply in_map_iff in Hc. destruct Hc as [f [<- Hf]]. apply filter_In in Hf. destruct Hf as [Hf Ek].
      apply Nat.eqb_eq in Ek. subst k. apply Hchoices, Hf. }
  split; [exact Hpool|]. split.
  - unfold p. apply Forall_forall. intros nl Hnl. apply in_map_iff in Hnl. destruct Hnl as [k [<- Hk]]. simpl.
    unfold classes in Hk. apply nodup_In, in_map_iff in Hk. destruct Hk as [d [Ek Hd]]. unfold size.
    destruct (filter (fun d => Nat.eqb k (fst d)) (team I)) as [|x l] eqn:E; [|simpl; lia]. exfalso.
    assert (X : In d []) by (rewrite <- E; apply filter_In; split; [exact Hd | rewrite Ek; apply Nat.eqb_refl]). contradiction.
  - rewrite <- team_size. replace (length plan) with (length (concat (by_classes cf))).
    2:{ rewrite (Permutation_length (by_classes_permutes cf)), map_length. reflexivity. }
    clear - Hpool. induction Hpool as [|[n l] L p Ls [H _] HP IH]; simpl; [lia|]. simpl in H. rewrite app_length. lia.
Qed.

(** ** Searches *)

Lemma search_keeps {A} threshold take_down conflict gs st (Q : A -> Prop) p a :
  (forall l a', Q a' -> Q (take_down l a')) -> Q a -> Q (search threshold take_down conflict gs st p a).
Proof.
  intros Hkeep Ha. set (keeps := fun (_ : list candidate) found => Q found).
  change (keeps [] (search threshold take_down conflict gs st p a)). unfold search. apply node_keeps; [|exact Ha].
  intros l l' a'. apply Hkeep.
Qed.

Section Searched.
Variables (st : step) (t : nat) (conflict : named -> named -> bool) (nm : flight -> named) (pr : flight -> Z).
Notation gs := (step_groups t).
Notation cf := (flown_candidate st t nm pr).
Hypothesis in_time : (t <= T)%nat.
Hypothesis holds : step_inv t st.
Hypothesis symmetric : forall a b, conflict a b = conflict b a.
Hypothesis fits : fits_together named conflict (map cf plan).

Notation profit := (profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of gs)).
Notation worth_in := (F named (amount_unit I) (weight_unit I) (precision M) (specs_of gs)).

(** A joint state that counts, with its numbers in order. *)
Definition counting (l : list candidate) : Prop :=
  counts named conflict (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (step_bases st) (floor st) l
  /\ Forall (cand_ok named (amount_unit I) coarse (specs_of gs)) l.

Lemma counting_permutes l l' : Permutation l l' -> counting l -> counting l'.
Proof. intros Hp [H1 H2]. split; [eapply counts_perm; eassumption | eapply Permutation_Forall; eassumption]. Qed.

Lemma plan_counts : counting (map cf plan).
Proof. split; [apply flown_counts; assumption | apply flown_candidates_ok; assumption]. Qed.

Lemma exact_worth_of l : counting l -> (worth_in l <= IZR (exact_of gs l))%R.
Proof. intros [_ H]. exact (exact_of_ok units_fine gs l (step_groups_ok t) H). Qed.

Lemma counting_enough l : counting l -> enough st l (exact_of gs l) = true.
Proof.
  intros H. pose proof (exact_worth_of l H) as HE. destruct H as [[_ [Hfl _]] _].
  unfold enough. apply Z.leb_le, le_IZR. rewrite plus_IZR. lra.
Qed.

Lemma profit_of_ok l : counting l -> (profit l <= IZR (profit_of st gs l))%R.
Proof.
  intros H. pose proof (exact_worth_of l H) as HE. destruct H as [[Hstatic _] _].
  apply least_static_ok; [exact Hstatic|]. unfold profitR. rewrite minus_IZR. lra.
Qed.

Lemma flown_worth_in plan' : Permutation plan plan' -> worth_in (map cf plan') = FR t.
Proof. intros Hp. rewrite <- (flown_worth st t nm pr in_time). symmetry. apply F_perm, Permutation_map, Hp. Qed.

Lemma flown_sum plan' (number : candidate -> Z) : Permutation plan plan' ->
  sum named number (map cf plan') = sumZ (map (fun f => number (cf f)) plan).
Proof.
  intros Hp. rewrite <- (sum_perm named number _ _ (Permutation_map cf Hp)). unfold sum. rewrite map_map. reflexivity.
Qed.

Lemma flown_profit plan' : Permutation plan plan' -> profit (map cf plan') = (FR t - IZR (sumZ (map pr plan)))%R.
Proof. intros Hp. unfold profitR. rewrite (flown_worth_in plan' Hp), (flown_sum plan' _ Hp). reflexivity. Qed.

Context {A : Type}.
Variables (threshold : A -> Z) (take_down : list candidate -> A -> A).

(** What is to hold of a joint state and of what a search brings back: if its profit is not above the
    threshold, once it is taken, and from then on. *)
Variable P : list candidate -> A -> Prop.
Hypothesis P_low : forall l a, counting l -> (profit l <= IZR (threshold a))%R -> P l a.
Hypothesis P_down : forall l a, counting l -> P l (take_down l a).
Hypothesis P_keep : forall l l' a, P l a -> P l (take_down l' a).

Lemma searched (singles : bool) p Ls a :
  (singles = false -> forall l l' a', Permutation l l' -> P l a' -> P l' a') ->
  (singles = true -> Forall (fun nl : nat * list candidate => fst nl = 1%nat) p) ->
  completes p Ls -> positive_counts p -> (drones_left p <= length (team I))%nat -> counting (concat Ls) ->
  P (concat Ls) (search threshold take_down conflict gs st p a).
Proof.
  intros Hperm Hones Hpool Hpositive Hleft Hcounting.
  set (Good := fun l a' => counting l -> P l a'). pose proof Hcounting as [Hcounts Hok].
  destruct (units I M units_fine) as [_ [_ [Za Zw]]]. destruct staged_parts as [_ [_ [Zc _]]].
  pose proof (worth_of_none t) as HF0.
  assert (Hlow : forall l a', (profit l <= IZR (threshold a'))%R -> Good l a') by (intros l a' Hl Hc; apply P_low; assumption).
  assert (Hdown : forall l a', Good l (take_down l a')) by (intros l a' Hc; apply P_down, Hc).
  assert (Hkeep : forall l l' a', Good l a' -> Good l (take_down l' a')) by (intros l l' a' H Hc; apply P_keep, H, Hc).
  assert (Hswap : singles = false -> forall pre x c y post a', Good (pre ++ c :: x ++ y ++ post) a' -> Good (pre ++ x ++ c :: y ++ post) a').
  { intros Es pre x c y post a' H Hc.
    assert (Hp : Permutation (pre ++ x ++ c :: y ++ post) (pre ++ c :: x ++ y ++ post)) by
      (apply Permutation_app_head; symmetry; apply Permutation_middle).
    apply (Hperm Es _ _ _ (Permutation_sym Hp)), H, (counting_permutes _ _ Hp), Hc. }
  refine (node_ok named conflict symmetric (amount_unit I) (weight_unit I) (precision M) coarse Za Zw precision_pos Zc
    (specs_of gs) (specs_of_ok gs (step_groups_ok t)) A threshold take_down Sorted.sort sorted_permutes memory (advise (specs_of gs))
    named_dec Good Hlow Hdown Hkeep singles Hswap (step_bases st) (floor st) (length (team I)) [] _ _ _ _ p mind a Ls
    Hpool Hpositive Hleft Hones Hok _ _ _ _ Hcounts Hcounting).
  - eapply (nothing_ok (amount_unit I)); try eassumption. apply Forall_forall. intros sp Hsp.
    exact (specs_of_ok gs (step_groups_ok t) sp Hsp).
  - rewrite HF0. unfold sum. simpl. lra.
  - rewrite HF0. unfold sum. simpl. rewrite opp_IZR. lra.
  - apply bases_first.
Qed.

(** Of each class, any of its states that are given. *)
Lemma classes_searched choices a : (forall l l' a', Permutation l l' -> P l a' -> P l' a') ->
  (forall f, In f plan -> In (cf f) (choices (fst f))) ->
  P (map cf plan) (search threshold take_down conflict gs st (map (fun k => (size I k, choices k)) (classes I)) a).
Proof.
  intros Hperm Hchoices. pose proof (by_classes_permutes cf) as HLs. set (Ls := by_classes cf) in *.
  destruct (class_pools_ok cf choices Hchoices) as [Hpool [Hpositive Hleft]]. fold Ls in Hpool.
  apply (Hperm _ _ _ HLs). apply (searched false); try assumption; [intros _; exact Hperm | discriminate|].
  apply (counting_permutes _ _ (Permutation_sym HLs)), plan_counts.
Qed.

(** Of each drone, any of its states that are given. *)
Lemma drones_searched plan' (p : pool candidate) a : Permutation plan plan' ->
  Forall2 (fun nl f => fst nl = 1%nat /\ (In f plan -> In (cf f) (snd nl))) p plan' ->
  P (map cf plan') (search threshold take_down conflict gs st p a).
Proof.
  intros Hperm Hp. set (L := map cf plan'). set (Ls := map (fun c => [c]) L).
  assert (EL : concat Ls = L).
  { unfold Ls. clear. induction L as [|c l IH]; simpl; [reflexivity | rewrite IH; reflexivity]. }
  assert (Hones : Forall (fun nl : nat * list candidate => fst nl = 1%nat) p).
  { clear - Hp. induction Hp as [|nl f p fs [H1 _] H IH]; constructor; assumption. }
  rewrite <- EL. apply (searched true); try discriminate; [intros _; exact Hones | | | |].
  - assert (Hp' : Forall2 (fun nl f => fst nl = 1%nat /\ In (cf f) (snd nl)) p plan').
    { eapply Forall2_weaken; [|apply (Forall2_in _ _ _ Hp)]. intros nl f [[H1 H2] [_ Hf']]. split; [exact H1|].
      exact (H2 (Permutation_in f (Permutation_sym Hperm) Hf')). }
    unfold Ls, L. clear - Hp'. induction Hp' as [|nl f p fs [H1 H2] H IH]; simpl; constructor; [|exact IH].
    split; [symmetry; exact H1|]. intros x [<- | []]. exact H2.
  - clear - Hones. induction Hones as [|nl p E H IH]; constructor; [rewrite E; lia | exact IH].
  - apply Forall2_lengths in Hp. rewrite <- (eq_trans Hp (eq_trans (eq_sym (Permutation_length Hperm)) team_size)). clear - Hones.
    induction Hones as [|nl p E H IH]; simpl; [lia|]. rewrite E. lia.
  - rewrite EL. apply (counting_permutes _ _ (Permutation_map cf Hperm)), plan_counts.
Qed.
End Searched.

(** ** The highest profit *)

Section Highest.
Variables (st : step) (t : nat) (conflict : named -> named -> bool) (nm : flight -> named) (pr : flight -> Z) (known : Z).
Notation gs := (step_groups t).
Notation cf := (flown_candidate st t nm pr).
Hypothesis in_time : (t <= T)%nat.
Hypothesis holds : step_inv t st.
Hypothesis symmetric : forall a b, conflict a b = conflict b a.
Hypothesis fits : fits_together named conflict (map cf plan).

Notation profit := (profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of gs)).
Definition within_best (l : list candidate) (best : Z) : Prop := (IZR known + profit l <= IZR best)%R.

Lemma raised_keeps l a (c : R) : (c <= IZR a)%R -> (c <= IZR (raised st gs known l a))%R.
Proof.
  intros H. eapply Rle_trans; [exact H|]. apply IZR_le. unfold raised.
  destruct (enough _ _ _); [apply Z.le_max_l | apply Z.le_refl].
Qed.

Lemma highest_keeps p a (c : R) : (c <= IZR a)%R -> (c <= IZR (highest conflict gs st known p a))%R.
Proof. apply (search_keeps _ _ _ _ _ (fun a => (c <= IZR a)%R)). intros. apply raised_keeps. assumption. Qed.

Lemma within_low l a : counting st t conflict l -> (profit l <= IZR (a - known))%R -> within_best l a.
Proof. intros _ H. unfold within_best. rewrite minus_IZR in H. lra. Qed.

Lemma within_down l a : counting st t conflict l -> within_best l (raised st gs known l a).
Proof.
  intros H. pose proof (profit_of_ok st t conflict l H) as HP. unfold within_best, raised.
  rewrite (counting_enough st t conflict l H). eapply Rle_trans; [apply Rplus_le_compat_l, HP|].
  rewrite <- plus_IZR. apply IZR_le. lia.
Qed.

Lemma highest_of_classes choices a : (forall f, In f plan -> In (cf f) (choices (fst f))) ->
  (IZR known + (FR t - IZR (sumZ (map pr plan)))
   <= IZR (highest conflict gs st known (map (fun k => (size I k, choices k)) (classes I)) a))%R.
Proof.
  intros Hchoices. rewrite <- (flown_profit st t nm pr in_time plan (Permutation_refl _)).
  apply (classes_searched st t conflict nm pr in_time holds symmetric fits _ _ within_best within_low within_down);
    [intros; apply raised_keeps; assumption | | exact Hchoices].
  intros l l' a' Hp H. unfold within_best, profitR in *. rewrite <- (F_perm _ _ _ _ _ _ _ Hp), <- (sum_perm _ (price named) _ _ Hp). exact H.
Qed.

Lemma highest_of_drones plan' p a : Permutation plan plan' ->
  Forall2 (fun nl f => fst nl = 1%nat /\ (In f plan -> In (cf f) (snd nl))) p plan' ->
  (IZR known + (FR t - IZR (sumZ (map pr plan))) <= IZR (highest conflict gs st known p a))%R.
Proof.
  intros Hperm Hp. rewrite <- (flown_profit st t nm pr in_time plan' Hperm).
  apply (drones_searched st t conflict nm pr in_time holds symmetric fits _ _ within_best within_low within_down);
    [intros; apply raised_keeps; assumption | exact Hperm | exact Hp].
Qed.
End Highest.
End Plan.
End Steps.
