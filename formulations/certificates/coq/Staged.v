(** Staged certificates: new prices and constants, step by step.

    What no joint state of a step exceeds at new prices is found by a search; then states are closed
    again. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation FMapPositive Sorting.Mergesort Orders.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search Narrowing.
Import ListNotations.
Open Scope Z_scope.

(** A constant of a step, and new prices that come with it: of some classes, prices of some states, and
    by how much those of all other states rise. If there are none, the constant alone is new. *)
Record setting := Setting { of_step : nat; payments : list (nat * (list (state * Z) * Z)); claim : Z }.
Definition stage : Type := list setting.  (* tried in this order *)

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

Section Staged.
Variables (I : instance) (C : certificate) (coarse : Z).

(** Who gives advice at a node of a search, and what it thinks at first. *)
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.

Notation T := (horizon I).
Notation M := (numbers C).
Notation rs := (all_rows C []).
Notation left_bound := (left_bound I C).
Notation sweep_all := (sweep_all I C).
Notation close := (close I C).
Notation staged_numbers_ok := (staged_numbers_ok I C coarse).
Notation map_of_map := (map_of_map I).
(** * The search of a step *)

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

Definition highest (gs : list group) (floor : Z) (bases : list base) (l : list candidate) (best : Z) : Z :=
  let worth := exact_of gs l in
  if floor + sum named (charge named) l <=? worth
  then Z.max best (least_static 0 bases l (worth - sum named (price named) l)) else best.

(** New prices of the states that are left at a step. *)
Definition repriced (st : step) (new : setting) : by_state :=
  map (fun k =>
    let old := map_of (u_prices (now st)) k in
    (k, match find (fun e => Nat.eqb k (fst e)) (payments new) with
        | None => old
        | Some (_, (listed, others)) =>
            let table := fold_left (fun m sv => PM.add (fst sv) (snd sv) m) listed (PM.empty Z) in
            PM.mapi (fun s v => match PM.find s table with Some p => p | None => v + others end) old
        end)) (classes I).

Definition step_bases (st : step) : list base :=
  (true, u_constant (now st) - floor st) :: map (fun u => (false, u_constant u)) (now st :: earlier st).

Definition step_static (st : step) (k : nat) (s : state) (price : Z) : list Z :=
  (number_of (u_prices (now st)) k s - number_of (charges st) k s)
  :: map (fun u => number_of (u_prices u) k s - price) (now st :: earlier st).

Definition here (k : nat) (s : state) : named := let p := place I k s in ((k, p), (p, s)).

Definition step_candidate (st : step) (gs : list group) (t k : nat) (s : state) (price : Z) : candidate :=
  candidate_of gs t k (here k s) price (number_of (charges st) k s) (step_static st k s price) s.

Definition search {A : Type} (threshold : A -> Z) (take_down : list candidate -> A -> A)
    (conflict : named -> named -> bool) (gs : list group) :=
  node named conflict coarse (specs_of gs) A threshold take_down Sorted.sort memory (advise (specs_of gs)).

(** The most that a joint state is worth at new prices, or the constant that is claimed. *)
Definition most_profit (st : step) (t : nat) (prices : by_state) (claim : Z) : Z :=
  let gs := step_groups t in
  search (fun best => best) (highest gs (floor st) (step_bases st)) places_meet gs (length (team I)) []
    (nothing (specs_of gs)) 0 (- floor st) (step_bases st)
    (map (fun k => (size I k, map (fun sv => step_candidate st gs t k (fst sv) (snd sv))
                                  (PM.elements (map_of prices k)))) (classes I)) mind claim.

(** A constant at the prices of before can only fall. *)
Definition after_constant (new : setting) (st : step) : step :=
  match payments new with
  | [] =>
      let prices := u_prices (now st) in
      let before := u_constant (now st) in
      if claim new <? before
      then Step (Upper (Z.min before (most_profit st (of_step new) prices (claim new))) prices)
                (earlier st) (floor st) (charges st)
      else st
  | _ =>
      let prices := repriced st new in
      Step (Upper (most_profit st (of_step new) prices (claim new)) prices)
           (now st :: earlier st) (floor st) (charges st)
  end.

Fixpoint change {B} (t : nat) (f : B -> B) (l : list B) : list B :=
  match l, t with
  | [], _ => []
  | b :: rest, O => f b :: rest
  | b :: rest, S t' => b :: change t' f rest
  end.

Definition after_stage (stg : stage) (N : narrowing) : narrowing :=
  fold_left (fun N new => change (of_step new) (after_constant new) N) stg N.

Fixpoint after_stages (target : Z) (stages : list stage) (N : narrowing) : option narrowing :=
  match stages with
  | [] => Some N
  | stg :: rest =>
      match close target (after_stage stg N) with
      | None => None
      | Some N' => after_stages target rest N'
      end
  end.

Definition first_narrowing : narrowing :=
  let reach := map (fun k => (k, in_reach I k)) (classes I) in
  map (fun t => Step (Upper (step_constant I M t)
      (map (fun k => (k, PM.mapi (fun s _ => paid I M k t s) (nth t (of_class [] reach k) (PM.empty Z)))) (classes I)))
      [] 0 []) (seq 0 (S T)).

(** The narrowing after all stages; None: no plan is above the target. *)
Definition narrowed (target : Z) (stages : list stage) : option narrowing :=
  match close target first_narrowing with
  | None => None
  | Some N => after_stages target stages N
  end.

(** What no plan is above, in 1/precision, by what is left above a target. *)
Definition bound_of (target : Z) (N : narrowing) : Z :=
  match left_bound N (sweep_all N) with None => target | Some b => Z.max target b end.

(** The same, by all stages; None: the certificate proves nothing. *)
Definition staged_bound (target : Z) (stages : list stage) : option Z :=
  if staged_numbers_ok then
    Some (match narrowed target stages with None => target | Some N => bound_of target N end)
  else None.

(** * Soundness *)

Lemma change_nth {B} (f : B -> B) (d : B) : forall l t j, (j < length l)%nat ->
  nth j (change t f l) d = if Nat.eqb j t then f (nth j l d) else nth j l d.
Proof.
  induction l as [|b l IH]; intros t j Hj; simpl in *; [lia|]. destruct t as [|t], j as [|j]; simpl; try reflexivity.
  apply IH. lia.
Qed.

Lemma change_length {B} (f : B -> B) : forall l t, length (change t f l) = length l.
Proof. induction l; intros [|t]; simpl; congruence. Qed.

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
Hypothesis ok : staged_numbers_ok = true.
Hypothesis planned : is_plan I plan.
Notation staged_parts := (staged_parts I C coarse ok).
Notation numbers_fine := (numbers_fine I C coarse ok).
Notation units_fine := (units_fine I C coarse ok).
Notation groups_fine := (groups_fine I C coarse ok).
Notation precision_pos := (precision_pos I C coarse ok).
Notation of_plan := (of_plan I plan planned).
Notation class_in := (class_in I plan planned).
Notation views_fine := (views_fine I C coarse plan ok planned).
Notation FR := (FR I C plan).
Notation prices_sum := (prices_sum plan).
Notation step_inv := (step_inv I C plan).
Notation inv := (inv I C plan).
Notation worth_of := (worth_of I C).
Notation all_prices := (all_prices plan).
Notation J_steps := (J_steps I C coarse plan ok planned).
Notation best_number := (best_number I C).
Notation team_best_is := (team_best_is I C plan planned).

Section Above.
Variable target : Z.
Hypothesis above : (IZR target < J I plan * IZR (precision M))%R.
Notation close_ok := (close_ok I C coarse plan ok planned target above).

(** ** The search of a step *)

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
  intros Ht Hname. destruct planned as [_ H]. unfold fits_together. clear ok above planned.
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

(** The most that is found bounds what a plan above the target is worth at the step. *)
Lemma most_profit_ok st t prices claimed : (t <= T)%nat -> step_inv t st ->
  (forall f, In f plan -> exists p, PM.find (snd f t) (map_of prices (fst f)) = Some p) ->
  (FR t <= IZR (most_profit st t prices claimed + prices_sum prices t))%R.
Proof.
  intros Ht Hinv Hnew.
  set (gs := step_groups t).
  set (pr := fun f : flight => number_of prices (fst f) (snd f t)).
  set (cf := flown_candidate st t (fun f => here (fst f) (snd f t)) pr).
  pose proof (step_groups_ok t) as Hgs. fold gs in Hgs.
  pose proof (flown_candidates_ok st t (fun f => here (fst f) (snd f t)) pr Ht) as Hcf. fold cf gs in Hcf.
  pose proof (flown_worth st t (fun f => here (fst f) (snd f t)) pr Ht) as HFL. fold cf gs in HFL.
  assert (Hprice : sum named (price named) (map cf plan) = prices_sum prices t).
  { unfold sum, prices_sum. rewrite map_map. reflexivity. }
  pose proof (flown_counts places_meet st t (fun f => here (fst f) (snd f t)) pr Ht Hinv (fits_pairs cf t Ht (fun f _ => eq_refl))) as Hcounts.
  fold cf gs in Hcounts.
  set (Ls := by_classes cf). pose proof (by_classes_permutes cf) as HLs. fold Ls in HLs.
  set (choices := fun k => map (fun sv => step_candidate st gs t k (fst sv) (snd sv)) (PM.elements (map_of prices k))).
  set (pool_ := map (fun k => (size I k, choices k)) (classes I)).
  destruct (class_pools_ok cf choices) as [Hpool [Hpositive Hleft]].
  { intros f Hf. destruct (Hnew f Hf) as [p Ep]. apply in_map_iff. exists (snd f t, p). split; [|apply PM.elements_correct, Ep].
    unfold cf, flown_candidate, pr. assert (En : number_of prices (fst f) (snd f t) = p) by (unfold number_of; rewrite Ep; reflexivity). rewrite En. reflexivity. }
  fold pool_ Ls in Hpool, Hpositive, Hleft.
  assert (Hcounts' : counts named places_meet (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (step_bases st) (floor st) ([] ++ concat Ls)).
  { eapply counts_perm; [exact places_meet_symmetric | apply Permutation_sym; exact HLs | exact Hcounts]. }
  set (Good := fun (l : list candidate) (best : Z) =>
    counts named places_meet (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (step_bases st) (floor st) l ->
    Forall (cand_ok named (amount_unit I) coarse (specs_of gs)) l ->
    (profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of gs) l <= IZR best)%R).
  destruct (units I M units_fine) as [_ [_ [Za Zw]]]. destruct staged_parts as [_ [_ [Zc _]]].
  assert (Hkeep : forall l l' (a : Z), Good l a -> Good l (highest gs (floor st) (step_bases st) l' a)).
  { intros l l' a H H1 H2. eapply Rle_trans; [apply H; assumption|]. apply IZR_le. unfold highest. cbv zeta.
    destruct (_ <=? _); lia. }
  assert (HokLs : Forall (cand_ok named (amount_unit I) coarse (specs_of gs)) ([] ++ concat Ls)).
  { eapply Permutation_Forall; [apply Permutation_sym; exact HLs | exact Hcf]. }
  pose proof (worth_of_none t) as HF0. fold gs in HF0.
  pose proof (node_ok named places_meet places_meet_symmetric (amount_unit I) (weight_unit I) (precision M) coarse Za Zw precision_pos Zc
    (specs_of gs) (specs_of_ok gs Hgs) Z (fun best => best) (highest gs (floor st) (step_bases st)) Sorted.sort sorted_permutes memory (advise (specs_of gs)) named_dec Good
    (fun l a H _ _ => H)
    ltac:(intros l a H1 H2; unfold highest; cbv zeta;
          pose proof (exact_of_ok units_fine gs l Hgs H2) as HE; destruct H1 as [Hstatic [Hfl _]];
          assert (Hle : floor st + sum named (charge named) l <= exact_of gs l) by (apply le_IZR; rewrite plus_IZR; lra);
          apply Z.leb_le in Hle; rewrite Hle;
          assert (Hleast : (profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of gs) l
              <= IZR (least_static 0 (step_bases st) l (exact_of gs l - sum named (price named) l)))%R) by
            (apply least_static_ok; [exact Hstatic | unfold profitR; rewrite minus_IZR; lra]);
          eapply Rle_trans; [exact Hleast | apply IZR_le; lia])
    Hkeep false
    ltac:(intros _ pre x c y post a H H1 H2;
          assert (Hp : Permutation (pre ++ x ++ c :: y ++ post) (pre ++ c :: x ++ y ++ post)) by
            (apply Permutation_app_head; symmetry; apply Permutation_middle);
          unfold profitR; rewrite (F_perm _ _ _ _ _ _ _ Hp), (sum_perm _ (price named) _ _ Hp); apply H;
          [eapply counts_perm; [exact places_meet_symmetric | exact Hp | exact H1] | eapply Permutation_Forall; eassumption])
    (step_bases st) (floor st) (length (team I)) [] (nothing (specs_of gs)) 0 (- floor st) (step_bases st) pool_ mind claimed Ls Hpool) as HN.
  assert (HG : Good ([] ++ concat Ls) (most_profit st t prices claimed)).
  { apply HN.
    - exact Hpositive.
    - exact Hleft.
    - discriminate.
    - exact HokLs.
    - eapply (nothing_ok (amount_unit I)); try eassumption. apply Forall_forall. intros sp Hsp. exact (specs_of_ok gs Hgs sp Hsp).
    - rewrite HF0. unfold sum. simpl. lra.
    - rewrite HF0. unfold sum. simpl. rewrite opp_IZR. lra.
    - apply bases_first.
    - exact Hcounts'. }
  specialize (HG Hcounts' HokLs). simpl app in HG. unfold profitR in HG.
  rewrite (F_perm _ _ _ _ _ _ _ HLs), (sum_perm _ (price named) _ _ HLs), HFL, Hprice in HG. simpl. rewrite plus_IZR. lra.
Qed.

Lemma repriced_ok st t new : step_inv t st ->
  forall f, In f plan -> exists p, PM.find (snd f t) (map_of (repriced st new) (fst f)) = Some p.
Proof.
  intros [HL _] f Hf. destruct (HL f Hf) as [v E]. unfold repriced.
  set (of := fun k => let old := map_of (u_prices (now st)) k in
    match find (fun e => Nat.eqb k (fst e)) (payments new) with
    | None => old
    | Some (_, (listed, others)) =>
        let table := fold_left (fun m sv => PM.add (fst sv) (snd sv) m) listed (PM.empty Z) in
        PM.mapi (fun s v => match PM.find s table with Some p => p | None => v + others end) old
    end).
  change (exists p, PM.find (snd f t) (map_of (map (fun k => (k, of k)) (classes I)) (fst f)) = Some p).
  rewrite map_of_map by (apply class_in, Hf). unfold of. cbv zeta.
  destruct (find _ (payments new)) as [[e [listed others]]|]; [|exists v; exact E].
  rewrite mapi_find, E. simpl. eexists. reflexivity.
Qed.

Lemma after_constant_ok new st : (of_step new <= T)%nat -> step_inv (of_step new) st ->
  step_inv (of_step new) (after_constant new st).
Proof.
  intros Ht Hinv. pose proof Hinv as [HL [HU HF]]. set (t := of_step new) in *. unfold after_constant. fold t.
  destruct (payments new) as [|e es] eqn:Ep.
  - destruct (claim new <? u_constant (now st)); [|exact Hinv]. split; [exact HL|]. split; [|exact HF].
    intros u [<- | Hu]; [|apply HU; right; exact Hu]. cbn [u_constant u_prices now].
    pose proof (HU (now st) (or_introl eq_refl)) as Hnow.
    pose proof (most_profit_ok st t (u_prices (now st)) (claim new) Ht Hinv HL) as Hmost.
    destruct (Z.min_spec (u_constant (now st)) (most_profit st t (u_prices (now st)) (claim new))) as [[_ ->] | [_ ->]]; assumption.
  - pose proof (repriced_ok st t new Hinv) as Hnew. split; [exact Hnew|]. split; [|exact HF].
    intros u [<- | Hu]; [|apply HU; exact Hu]. cbn [u_constant u_prices now].
    apply most_profit_ok; assumption.
Qed.

Lemma after_stage_ok stg N : inv N -> inv (after_stage stg N).
Proof.
  unfold after_stage. revert N. induction stg as [|new l IH]; intros N HN; [exact HN|]. simpl.
  apply IH. destruct HN as [Hlen HN]. split; [rewrite change_length; exact Hlen|]. intros j Hj. unfold at_.
  rewrite change_nth by lia. fold (at_ N j). destruct (Nat.eqb_spec j (of_step new)) as [E | Hne]; [|apply HN, Hj].
  subst j. apply after_constant_ok; [exact Hj | apply HN, Hj].
Qed.

Lemma first_ok' : inv first_narrowing.
Proof.
  unfold first_narrowing. split; [rewrite map_length, seq_length; reflexivity|]. intros t Ht.
  assert (Hat : forall (f : nat -> step), at_ (map f (seq 0 (S T))) t = f t).
  { intros f. unfold at_. rewrite (nth_indep _ no_step (f O)) by (rewrite map_length, seq_length; lia).
    rewrite map_nth, seq_nth by lia. reflexivity. }
  rewrite Hat. destruct staged_parts as [_ [Ho _]].
  assert (Hfind : forall f, In f plan -> PM.find (snd f t) (map_of (map (fun k => (k, PM.mapi (fun s (_ : Z) => paid I M k t s)
      (nth t (of_class [] (map (fun k => (k, in_reach I k)) (classes I)) k) (PM.empty Z)))) (classes I)) (fst f)) = Some (paid I M (fst f) t (snd f t))).
  { intros f Hf. rewrite map_of_map by (apply class_in, Hf). rewrite mapi_find, of_class_map by (apply class_in, Hf).
    destruct (of_plan f Hf) as [starts [Hd [Hs Hfl]]].
    destruct (Forall2_seq_nth _ (PM.empty Z) _ _ _ (reach_ok I (fst f) starts f Hd eq_refl Hs Hfl) t ltac:(lia)) as [u Eu].
    rewrite Nat.add_0_l in Eu. rewrite Eu. reflexivity. }
  split; [|split].
  - intros f Hf. simpl. eexists. apply Hfind, Hf.
  - simpl. intros u [<- | []]. simpl.
    pose proof (step_bound I M units_fine groups_fine plan classes_of_plan views_fine t Ho Ht) as H.
    apply (Rmult_le_compat_l (IZR (precision M))) in H; [|apply IZR_nonneg; pose proof precision_pos; lia].
    unfold FR. eapply Rle_trans; [exact H|].
    replace (prices_sum _ t) with (paid_at I M plan t).
    2:{ unfold prices_sum, paid_at. apply sumZ_ext. intros f Hf. unfold number_of. rewrite (Hfind f Hf). reflexivity. }
    pose proof (IZR_pos _ precision_pos) as Pp. apply Req_le. rewrite !plus_IZR. field. lra.
  - simpl. replace (prices_sum [] t) with 0.
    2:{ unfold prices_sum. symmetry. apply sumZ_zero. intros f _. unfold number_of, map_of. simpl. rewrite PM.gempty. reflexivity. }
    simpl. unfold FR. apply Rmult_le_pos; [apply IZR_nonneg; pose proof precision_pos; lia|].
    unfold step_worth. apply sumR_nonneg. apply Forall_forall. intros x Hx. apply in_map_iff in Hx. destruct Hx as [g [<- Hg]].
    destruct (group_parts I M g (group_is_ok I M groups_fine g Hg)) as [Hw [_ Hr]]. destruct (units I M units_fine) as [_ [_ [Za Zw]]].
    unfold worth. apply Rmult_le_pos; [apply frac_nonneg; assumption|]. apply return_nonneg; [exact Hr|].
    apply frac_nonneg; [|exact Za]. unfold seen_at. apply sumZ_nonneg. intros f Hf. apply (amounts_nonneg I M groups_fine plan views_fine); assumption.
Qed.

Lemma narrowed_ok stages : exists N, narrowed target stages = Some N /\ inv N.
Proof.
  unfold narrowed. destruct (close_ok _ first_ok') as [N0 [E0 H0]]. rewrite E0. clear E0.
  revert N0 H0. induction stages as [|stg rest IH]; intros N0 H0; simpl; [exists N0; auto|].
  destruct (close_ok _ (after_stage_ok stg N0 H0)) as [N1 [E1 H1]]. rewrite E1. apply IH, H1.
Qed.

End Above.
End Plan.

Notation precision_pos := (precision_pos I C coarse).
Notation team_best_is := (team_best_is I C).
Notation J_steps := (J_steps I C coarse).
Notation FR := (FR I C).
Notation worth_of := (worth_of I C).

Theorem staged_bound_sound target stages b plan :
  staged_bound target stages = Some b -> is_plan I plan -> (J I plan <= IZR b / IZR (precision M))%R.
Proof.
  unfold staged_bound. intros Hb Hp. destruct staged_numbers_ok eqn:Hok; [|discriminate]. injection Hb as <-. unfold bound_of.
  pose proof (IZR_pos _ (precision_pos Hok)) as Pp.
  apply Rmult_le_reg_r with (IZR (precision M)); [exact Pp|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
  destruct (Rle_dec (J I plan * IZR (precision M)) (IZR target)) as [L | G].
  - eapply Rle_trans; [exact L|]. apply IZR_le. destruct (narrowed target stages); [|lia]. destruct (left_bound _ _); lia.
  - apply Rnot_le_lt in G.
    destruct (narrowed_ok plan Hok Hp target G stages) as [N [EN HN]]. rewrite EN.
    destruct (team_best_is plan Hp N HN) as [EB Hworths]. rewrite EB.
    eapply Rle_trans; [apply (J_steps plan Hok Hp N)|].
    destruct HN as [Hlen HN].
    assert (Hsum : forall n, (n <= S T)%nat -> (sumR (map (FR plan) (seq 0 n))
       <= IZR (total n (fun t => u_constant (now (at_ N t)) + prices_sum plan (u_prices (now (at_ N t))) t)%Z))%R).
    { induction n as [|n IH]; intros Hn; [simpl; lra|]. rewrite seq_S, map_app, sumR_app. cbn [map sumR total Nat.add].
      rewrite plus_IZR. specialize (IH ltac:(lia)). destruct (HN n ltac:(lia)) as [_ [HU _]].
      specialize (HU (now (at_ N n)) (or_introl eq_refl)). lra. }
    specialize (Hsum (S T) (le_n _)). rewrite total_add in Hsum.
    assert (EK : total_constant N = total (S T) (fun t => u_constant (now (at_ N t)))).
    { unfold total_constant, at_. rewrite (sum_nth (fun st => u_constant (now st)) no_step), Hlen. reflexivity. }
    unfold all_prices.
    set (prices_all := total (S T) (fun t => prices_sum plan (u_prices (now (at_ N t))) t)) in *.
    apply Rle_trans with (IZR (total_constant N + prices_all + (sumZ (map (worth_of N) plan) - prices_all + row_constant C []))%Z).
    + rewrite EK, !plus_IZR. rewrite plus_IZR in Hsum. lra.
    + apply IZR_le. lia.
Qed.

End Staged.
