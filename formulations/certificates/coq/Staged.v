(** Staged certificates: new prices and constants, step by step, and constants of moves.

    What no joint state of a step exceeds at new prices is found by a search, as is what the team does
    not exceed in a move; then states are closed again. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Permutation FMapPositive.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search Narrowing Joints Steps Moves.
Import ListNotations.
Open Scope Z_scope.

(** A constant of a step, and new prices that come with it: of some classes, prices of some states, and
    by how much those of all other states rise. If there are none, the constant alone is new. *)
Record setting := Setting { of_step : nat; payments : list (nat * (list (state * Z) * Z)); claim : Z }.

(** Settings, and constants of moves, each with the step at which it begins; tried in this order. *)
Record stage := Stage { settings : list setting; moves_claimed : list (nat * Z) }.

Section Staged.
Variables (I : instance) (C : certificate) (coarse : Z).

(** Who gives advice at a node of a search, and what it thinks at first. *)
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.

Notation T := (horizon I).
Notation M := (numbers C).
Notation left_bound := (left_bound I C).
Notation sweep_all := (sweep_all I C).
Notation close := (close I C).
Notation staged_numbers_ok := (staged_numbers_ok I C coarse).
Notation map_of_map := (map_of_map I).

(** * New prices and constants *)

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

(** The most that a joint state is worth at new prices, or the constant that is claimed. *)
Definition most_profit (st : step) (t : nat) (prices : by_state) (claim : Z) : Z :=
  let gs := step_groups I C t in
  highest I C coarse memory advise mind (places_meet I) gs st 0 (class_pools I coarse st gs t prices) claim.

(** A constant at the prices of before can only fall. *)
Definition after_constant (new : setting) (st : step) : step :=
  match payments new with
  | [] =>
      let prices := u_prices (now st) in
      let before := u_constant (now st) in
      if claim new <? before
      then Step (Upper (Z.min before (most_profit st (of_step new) prices (claim new))) prices)
                (earlier st) (floor st) (charges st) (with_next st)
      else st
  | _ =>
      let prices := repriced st new in
      Step (Upper (most_profit st (of_step new) prices (claim new)) prices)
           (now st :: earlier st) (floor st) (charges st) (with_next st)
  end.

Fixpoint change {B} (t : nat) (f : B -> B) (l : list B) : list B :=
  match l, t with
  | [], _ => []
  | b :: rest, O => f b :: rest
  | b :: rest, S t' => b :: change t' f rest
  end.

(** Other constants of moves, by the steps at which they begin. *)
Definition with_moves (f : nat -> option Z -> option Z) (N : narrowing) : narrowing :=
  with_steps (fun t st => Step (now st) (earlier st) (floor st) (charges st) (f t (with_next st))) 0 N.

(** New prices of a step end the constants of the moves to it and from it. *)
Definition after_setting (new : setting) (N : narrowing) : narrowing :=
  let t := of_step new in
  let N' := change t (after_constant new) N in
  match payments new with
  | [] => N'
  | _ => with_moves (fun j m => if Nat.eqb j t || Nat.eqb (S j) t then None else m) N'
  end.

(** A new constant of a move ends those of the moves that share a step with it. *)
Definition after_move (claimed : nat * Z) (N : narrowing) : narrowing :=
  let t := fst claimed in
  if Nat.ltb t T then
    let most := move_constant I C coarse memory advise mind N t (snd claimed) in
    with_moves (fun j m => if Nat.eqb j t then Some (match m with Some before => Z.min before most | None => most end)
                           else if Nat.eqb (S j) t || Nat.eqb j (S t) then None else m) N
  else N.

Definition after_stage (stg : stage) (N : narrowing) : narrowing :=
  fold_left (fun N claimed => after_move claimed N) (moves_claimed stg)
            (fold_left (fun N new => after_setting new N) (settings stg) N).

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
      [] 0 [] None) (seq 0 (S T)).

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

Section Plan.
Variable plan : list flight.
Hypothesis ok : staged_numbers_ok = true.
Hypothesis planned : is_plan I plan.
Notation staged_parts := (staged_parts I C coarse ok).
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

Notation paid_now := (paid_now plan).
Notation classes_of_plan := (classes_of_plan I plan planned).

(** ** Constants *)

Lemma most_profit_ok st t prices claimed : (t <= T)%nat -> step_inv t st ->
  (forall f, In f plan -> exists p, PM.find (snd f t) (map_of prices (fst f)) = Some p) ->
  (FR t <= IZR (most_profit st t prices claimed + prices_sum prices t))%R.
Proof.
  intros Ht Hinv Hnew. unfold most_profit, class_pools. cbv zeta. set (gs := step_groups I C t).
  set (nm := fun f : flight => here I (fst f) (snd f t)). set (pr := fun f : flight => number_of prices (fst f) (snd f t)).
  pose proof (highest_of_classes I C coarse memory advise mind plan ok planned st t (places_meet I) nm pr 0 Ht Hinv
    (places_meet_symmetric I) (fits_pairs I plan planned (flown_candidate I C coarse st t nm pr) t Ht (fun f _ => eq_refl))
    (fun k => map (fun sv => step_candidate I coarse st gs t k (fst sv) (snd sv)) (PM.elements (map_of prices k))) claimed) as H.
  change (sumZ (map pr plan)) with (prices_sum prices t) in H. fold gs in H. rewrite plus_IZR.
  enough (Hin : forall f, In f plan -> In (flown_candidate I C coarse st t nm pr f)
      (map (fun sv => step_candidate I coarse st gs t (fst f) (fst sv) (snd sv)) (PM.elements (map_of prices (fst f))))).
  { specialize (H Hin). lra. }
  intros f Hf. destruct (Hnew f Hf) as [p Ep]. apply in_map_iff. exists (snd f t, p). split; [|apply PM.elements_correct, Ep].
  assert (En : pr f = p) by (unfold pr, number_of; rewrite Ep; reflexivity). unfold flown_candidate. rewrite En. reflexivity.
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

(** Other constants of moves, and all else as before. *)
Lemma with_moves_ok f N : length N = S T -> (forall t, (t <= T)%nat -> step_inv t (at_ N t)) ->
  (forall t m, (t <= T)%nat -> f t (with_next (at_ N t)) = Some m -> (t < T)%nat /\ f (S t) (with_next (at_ N (S t))) = None
     /\ (FR t + FR (S t) <= IZR (m + paid_now N t + paid_now N (S t)))%R) ->
  inv (with_moves f N).
Proof.
  intros Hlen Hsteps Hmoves. unfold with_moves.
  set (N' := with_steps _ 0 N).
  assert (Hat : forall t, (t <= T)%nat -> at_ N' t = Step (now (at_ N t)) (earlier (at_ N t)) (floor (at_ N t)) (charges (at_ N t)) (f t (with_next (at_ N t)))).
  { intros t Ht. unfold at_, N'. rewrite with_steps_nth by lia. reflexivity. }
  split; [split|].
  - unfold N'. rewrite with_steps_length. exact Hlen.
  - intros t m E. destruct (Nat.le_gt_cases t T) as [Ht | Ht].
    + rewrite Hat in E by exact Ht. destruct (Hmoves t m Ht E) as [H1 [H2 H3]]. split; [exact H1|]. rewrite (Hat (S t) H1).
      split; [exact H2|]. unfold Narrowing.paid_now in *. rewrite (Hat t Ht), (Hat (S t) H1). exact H3.
    + unfold at_, N' in E. rewrite nth_overflow in E by (rewrite with_steps_length; lia). discriminate.
  - intros t Ht. rewrite Hat by exact Ht. exact (Hsteps t Ht).
Qed.

Lemma after_setting_ok new N : inv N -> inv (after_setting new N).
Proof.
  intros HN. pose proof HN as [[Hlen Hmoves] Hsteps]. unfold after_setting. cbv zeta. set (t := of_step new).
  set (N' := change t (after_constant new) N).
  assert (Hlen' : length N' = S T) by (unfold N'; rewrite change_length; exact Hlen).
  assert (Hat : forall j, at_ N' j = if (Nat.eqb j t && Nat.leb j T)%bool then after_constant new (at_ N j) else at_ N j).
  { intros j. unfold at_, N'. destruct (Nat.leb_spec j T) as [Hj | Hj].
    - rewrite change_nth by lia. rewrite andb_true_r. reflexivity.
    - rewrite andb_false_r, !nth_overflow by (rewrite ?change_length; lia). reflexivity. }
  assert (Hsteps' : forall j, (j <= T)%nat -> step_inv j (at_ N' j)).
  { intros j Hj. rewrite Hat. destruct (Nat.eqb_spec j t) as [E | E]; cbn [andb]; [|apply Hsteps, Hj].
    destruct (Nat.leb_spec j T); [|apply Hsteps, Hj]. subst j. apply after_constant_ok; [exact Hj | apply Hsteps, Hj]. }
  destruct (payments new) as [|e es] eqn:Ep.
  - assert (Hsame : forall j, with_next (at_ N' j) = with_next (at_ N j) /\ u_prices (now (at_ N' j)) = u_prices (now (at_ N j))).
    { intros j. rewrite Hat. destruct (Nat.eqb j t && Nat.leb j T)%bool; [|auto]. unfold after_constant. rewrite Ep. cbv zeta.
      destruct (_ <? _); auto. }
    split; [split; [exact Hlen'|] | exact Hsteps'].
    intros j m E. rewrite (proj1 (Hsame j)) in E. destruct (Hmoves j m E) as [H1 [H2 H3]]. split; [exact H1|].
    rewrite (proj1 (Hsame (S j))). split; [exact H2|]. unfold Narrowing.paid_now. rewrite (proj2 (Hsame j)), (proj2 (Hsame (S j))). exact H3.
  - apply with_moves_ok; [exact Hlen' | exact Hsteps' |].
    intros j m Hj E. destruct (Nat.eqb_spec j t) as [Ej | Ej]; [discriminate|].
    destruct (Nat.eqb_spec (S j) t) as [Ej' | Ej']; [discriminate|]. cbn [orb] in E.
    assert (Hsame : forall i, i <> t -> at_ N' i = at_ N i) by (intros i Hi; rewrite Hat; apply Nat.eqb_neq in Hi; rewrite Hi; reflexivity).
    rewrite Hsame in E by exact Ej. destruct (Hmoves j m E) as [H1 [H2 H3]]. split; [exact H1|]. rewrite (Hsame (S j) Ej'), H2.
    split; [destruct (_ || _); reflexivity|]. unfold Narrowing.paid_now. rewrite (Hsame j Ej), (Hsame (S j) Ej'). exact H3.
Qed.

Lemma after_move_ok claimed N : inv N -> inv (after_move claimed N).
Proof.
  intros HN. pose proof HN as [[Hlen Hmoves] Hsteps]. unfold after_move. cbv zeta. set (t := fst claimed).
  destruct (Nat.ltb_spec t T) as [Ht | _]; [|exact HN].
  pose proof (move_constant_ok I C coarse memory advise mind plan ok planned N t (snd claimed) HN Ht) as Hmost.
  set (most := move_constant I C coarse memory advise mind N t (snd claimed)) in *.
  apply with_moves_ok; [exact Hlen | exact Hsteps |].
  intros j m Hj E. destruct (Nat.eqb_spec j t) as [-> | Ej].
  - injection E as <-. split; [exact Ht|]. split.
    + destruct (Nat.eqb_spec (S t) t); [lia|]. rewrite Nat.eqb_refl, orb_true_r. reflexivity.
    + destruct (with_next (at_ N t)) as [before|] eqn:E; [|exact Hmost].
      destruct (Hmoves t before E) as [_ [_ H3]]. destruct (Z.min_spec before most) as [[_ ->] | [_ ->]]; assumption.
  - destruct (Nat.eqb_spec (S j) t) as [Ej' | Ej']; [discriminate|]. destruct (Nat.eqb_spec j (S t)) as [E' | E']; [discriminate|].
    cbn [orb] in E. destruct (Hmoves j m E) as [H1 [H2 H3]]. split; [exact H1|]. rewrite H2. split; [|exact H3].
    destruct (_ || _); reflexivity.
Qed.

Lemma after_stage_ok stg N : inv N -> inv (after_stage stg N).
Proof.
  unfold after_stage. intros HN.
  assert (H : inv (fold_left (fun N new => after_setting new N) (settings stg) N)).
  { revert N HN. induction (settings stg) as [|new l IH]; intros N HN; [exact HN|]. simpl. apply IH, after_setting_ok, HN. }
  clear HN. revert H. generalize (fold_left (fun N new => after_setting new N) (settings stg) N) as N1.
  induction (moves_claimed stg) as [|c l IH]; intros N1 H; [exact H|]. simpl. apply IH, after_move_ok, H.
Qed.

Lemma first_ok' : inv first_narrowing.
Proof.
  unfold first_narrowing.
  assert (Hat : forall (f : nat -> step) t, (t <= T)%nat -> at_ (map f (seq 0 (S T))) t = f t).
  { intros f t Ht. unfold at_. rewrite (nth_indep _ no_step (f O)) by (rewrite map_length, seq_length; lia).
    rewrite map_nth, seq_nth by lia. reflexivity. }
  split; [split; [rewrite map_length, seq_length; reflexivity|]|].
  { intros t m E. destruct (Nat.le_gt_cases t T) as [Ht | Ht]; [rewrite Hat in E by exact Ht; discriminate|].
    unfold at_ in E. rewrite nth_overflow in E by (rewrite map_length, seq_length; lia). discriminate. }
  intros t Ht.
  rewrite Hat by exact Ht. destruct staged_parts as [_ [Ho _]].
  assert (Hfind : forall f, In f plan -> PM.find (snd f t) (map_of (map (fun k => (k, PM.mapi (fun s (_ : Z) => paid I M k t s)
      (nth t (of_class [] (map (fun k => (k, in_reach I k)) (classes I)) k) (PM.empty Z)))) (classes I)) (fst f)) = Some (paid I M (fst f) t (snd f t))).
  { intros f Hf. rewrite map_of_map by (apply class_in, Hf). rewrite mapi_find, of_class_map by (apply class_in, Hf).
    destruct (of_plan f Hf) as [starts [Hd [Hs Hfl]]].
    destruct (Forall2_seq_nth _ (PM.empty Z) _ _ _ (reach_ok I (fst f) starts f Hd eq_refl Hs Hfl) t ltac:(lia)) as [u Eu].
    rewrite Nat.add_0_l in Eu. rewrite Eu. reflexivity. }
  split; [|split].
  - intros f Hf. simpl. eexists. apply Hfind, Hf.
  - simpl. intros u [<- | []]. simpl.
    pose proof (step_bound I M units_fine groups_fine plan classes_of_plan (proj2 planned) views_fine t Ho Ht) as H.
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

Section Above.
Variable target : Z.
Hypothesis above : (IZR target < J I plan * IZR (precision M))%R.
Notation close_ok := (close_ok I C coarse plan ok planned target above).

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
Notation J_left := (J_left I C coarse).

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
    eapply Rle_trans; [apply (J_left plan Hok Hp N HN)|]. apply IZR_le. lia.
Qed.

End Staged.
