(** The checker of certificates by multipliers and of proof trees, and that its answer is right. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz FMapPositive.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep.
Import ListNotations.
Open Scope Z_scope.

Record certificate := Certificate { numbers : multipliers; rules : list row }.

(** Finds what was computed for a class. *)
Fixpoint of_class {A} (default : A) (table : list (nat * A)) (k : nat) : A :=
  match table with
  | [] => default
  | (k', a) :: rest => if Nat.eqb k k' then a else of_class default rest k
  end.

Lemma of_class_map {A} (default : A) f l k : In k l -> of_class default (map (fun k => (k, f k)) l) k = f k.
Proof.
  induction l as [|k' l IH]; [contradiction|]. simpl. intros H.
  destruct (Nat.eqb_spec k k') as [-> | Hne]; [reflexivity|]. apply IH. destruct H; [congruence | assumption].
Qed.

Section Checker.
Variables (I : instance) (C : certificate) (decisions : list row).
Notation T := (horizon I).
Notation M := (numbers C).

Definition all_rows : list row := rules C ++ decisions.

Definition classes : list nat := nodup Nat.eq_dec (map fst (team I)).

(** The reward of a move, rounded up to 1/precision. *)
Definition reward (k : nat) (s s' : state) : Z := cdiv (precision M * bonus I k s s') (weight_unit I).

Definition toll (k t : nat) (s : state) : state -> Z :=
  let charge := charge_moving I all_rows k t s in
  fun s' => reward k s s' - charge s'.

Definition price (k t : nat) (s : state) : Z := paid I M k t s - charge_here I all_rows k t s.

Definition starts_of (k : nat) : list state :=
  flat_map snd (filter (fun d => Nat.eqb k (fst d)) (team I)).

(** The states in reach, step by step. *)
Definition in_reach (k : nat) : list (PM.t Z) :=
  forward (moves I k) (open I k) (fun _ _ => 0) (fun _ _ _ => 0) T 0
    (fold_left (fun m s => if open I k 0 s then lift s 0 m else m) (starts_of k) (PM.empty Z)).

Fixpoint views_in_reach_ok (k t : nat) (Us : list (PM.t Z)) : bool :=
  match Us with
  | [] => true
  | U :: rest => forallb (fun sv => views_ok I M k t (fst sv)) (PM.elements U) && views_in_reach_ok k (S t) rest
  end.

(** The most that paths of a class are worth; None if what they see is not as it must be. *)
Definition best_paths (k : nat) : option (PM.t (option Z)) :=
  let Us := in_reach k in
  if views_in_reach_ok k 0 Us
  then match backward (moves I k) (price k) (toll k) 0 Us with [] => None | V :: _ => Some V end
  else None.

Definition best_start (V : PM.t (option Z)) (starts : list state) : option Z :=
  largest (fun s => match PM.find s V with Some v => v | None => None end) starts None.

(** What all drones together get at most; None if one has no path. *)
Fixpoint team_best (V : nat -> PM.t (option Z)) (drones : list (nat * list state)) : option Z :=
  match drones with
  | [] => Some 0
  | (k, starts) :: rest =>
      match best_start (V k) starts, team_best V rest with
      | Some a, Some b => Some (a + b)
      | _, _ => None
      end
  end.

Fixpoint all_there {A} (l : list (nat * option A)) : option (list (nat * A)) :=
  match l with
  | [] => Some []
  | (k, Some a) :: rest => match all_there rest with Some r => Some ((k, a) :: r) | None => None end
  | (_, None) :: _ => None
  end.

Definition numbers_ok : bool :=
  units_ok I M && forallb (group_ok I M) (groups I)
  && forallb (rule_ok I) (rules C) && forallb row_ok decisions.

Definition row_constant : Z := sumZ (map (fun r => sign r * count r * multiplier r) all_rows).

(** None: the certificate proves nothing.  Some None: there is no plan.  Some (Some b): no plan has
    J above b / precision. *)
Definition bound : option (option Z) :=
  if numbers_ok then
    match all_there (map (fun k => (k, best_paths k)) classes) with
    | None => None
    | Some table => Some (match team_best (of_class (PM.empty _) table) (team I) with
                          | None => None
                          | Some v => Some (constants I M + row_constant + v) end)
    end
  else None.

Definition check (numerator denominator : Z) : bool :=
  match bound with
  | None => false
  | Some None => true
  | Some (Some b) => (0 <? denominator) && (b * denominator <=? numerator * precision M)
  end.

(** * Soundness *)

Lemma reward_R k s s' : units_ok I M = true ->
  (IZR (bonus I k s s') / IZR (weight_unit I) <= IZR (reward k s s') / IZR (precision M))%R.
Proof.
  intros Hu. destruct (units I M Hu) as [_ [Zu [_ Zw]]]. unfold reward.
  pose proof (cdiv_R (precision M * bonus I k s s') _ Zw) as H. rewrite mult_IZR in H. apply IZR_pos in Zu, Zw.
  apply Rmult_le_reg_r with (IZR (precision M)); [exact Zu|].
  unfold Rdiv at 2. rewrite Rmult_assoc, Rinv_l by lra. rewrite Rmult_1_r. eapply Rle_trans; [|exact H].
  apply Req_le. field. lra.
Qed.

Lemma all_there_in {A} (f : nat -> option A) (default : A) l : forall table,
  all_there (map (fun k => (k, f k)) l) = Some table ->
  forall k, In k l -> f k = Some (of_class default table k).
Proof.
  induction l as [|k' l IH]; intros table H k Hin; [contradiction|]. simpl in H.
  destruct (f k') as [a|] eqn:E; [|discriminate].
  destruct (all_there (map (fun k => (k, f k)) l)) as [r|]; [|discriminate]. injection H as <-.
  simpl. destruct (Nat.eqb_spec k k') as [-> | Hne]; [exact E|].
  apply (IH r eq_refl). destruct Hin; [congruence | assumption].
Qed.

(** What the path of a drone is worth at these prices. *)
Definition path_value (f : flight) : Z := value T (price (fst f)) (toll (fst f)) (snd f).

Lemma path_value_split f : path_value f
  = total (S T) (fun t => paid I M (fst f) t (snd f t))
    + total T (fun t => reward (fst f) (snd f t) (snd f (S t)))
    - sumZ (map (fun r => sign r * multiplier r * path_uses I (used r) f) all_rows).
Proof.
  rewrite <- charges_of_path. unfold path_value, value.
  assert (E1 : total (S T) (fun t => price (fst f) t (snd f t))
     = total (S T) (fun t => paid I M (fst f) t (snd f t)) + -1 * total (S T) (fun t => charge_here I all_rows (fst f) t (snd f t))).
  { rewrite <- total_scale, <- total_add. apply total_ext. intros. unfold price. lia. }
  assert (E2 : total T (fun t => toll (fst f) t (snd f t) (snd f (S t)))
     = total T (fun t => reward (fst f) (snd f t) (snd f (S t)))
       + -1 * total T (fun t => charge_moving I all_rows (fst f) t (snd f t) (snd f (S t)))).
  { rewrite <- total_scale, <- total_add. apply total_ext. intros. unfold toll. lia. }
  rewrite E1, E2. lia.
Qed.

Section Plan.
Variable plan : list flight.
Hypothesis ok : numbers_ok = true.
Hypothesis planned : is_plan I plan.
Hypothesis decided : Forall (holds I plan) decisions.

Lemma ok_parts : units_ok I M = true /\ forallb (group_ok I M) (groups I) = true
  /\ forallb (rule_ok I) (rules C) = true /\ forallb row_ok decisions = true.
Proof. pose proof ok as H. unfold numbers_ok in H. split_andb. auto. Qed.

Lemma rows_hold : sumZ (map (fun r => sign r * multiplier r * plan_uses I (used r) plan) all_rows) <= row_constant.
Proof.
  destruct ok_parts as [_ [_ [Hrules Hdec]]]. apply sumZ_le. intros r Hr.
  assert (0 <= multiplier r /\ holds I plan r) as [Hm Hh].
  { apply in_app_or in Hr. destruct Hr as [Hr | Hr].
    - rewrite forallb_forall in Hrules. specialize (Hrules r Hr). split.
      + unfold rule_ok, row_ok in Hrules. split_andb. to_Z. assumption.
      + apply rule_holds; [assumption | apply planned].
    - rewrite forallb_forall in Hdec. specialize (Hdec r Hr). unfold row_ok in Hdec. to_Z.
      rewrite Forall_forall in decided. auto. }
  unfold holds in Hh. nia.
Qed.

Lemma team_classes : map fst plan = map fst (team I).
Proof.
  destruct planned as [H _]. clear decided planned. induction H as [|d f ds fs [E _] H IH]; [reflexivity|]. simpl. f_equal; assumption.
Qed.

(** What is paid, the rewards and the rows' constants are worth no less than what paths bring. *)
Lemma paths_together :
  sumZ (map (fun f => total (S T) (fun t => paid I M (fst f) t (snd f t))) plan)
  + sumZ (map (fun f => total T (fun t => reward (fst f) (snd f t) (snd f (S t)))) plan)
  <= sumZ (map path_value plan) + row_constant.
Proof.
  pose proof rows_hold as H. rewrite <- charges_of_plan in H.
  enough (E : sumZ (map path_value plan)
    = sumZ (map (fun f => total (S T) (fun t => paid I M (fst f) t (snd f t))) plan)
      + sumZ (map (fun f => total T (fun t => reward (fst f) (snd f t) (snd f (S t)))) plan)
      + -1 * sumZ (map (fun f => sumZ (map (fun r => sign r * multiplier r * path_uses I (used r) f) all_rows)) plan)).
  { rewrite E. lia. }
  rewrite <- sumZ_scale, <- !sumZ_add. apply sumZ_ext. intros f _. rewrite path_value_split. lia.
Qed.

Lemma bonuses_R : (IZR (sumZ (map (bonuses I) plan)) / IZR (weight_unit I)
  <= IZR (sumZ (map (fun f => total T (fun t => reward (fst f) (snd f t) (snd f (S t)))) plan)) / IZR (precision M))%R.
Proof.
  destruct ok_parts as [Hu _]. destruct (units I M Hu) as [_ [Zu [_ Zw]]].
  assert (H : forall f, (IZR (bonuses I f) / IZR (weight_unit I)
     <= IZR (total T (fun t => reward (fst f) (snd f t) (snd f (S t)))) / IZR (precision M))%R).
  { intros f. unfold bonuses. generalize T as n. induction n as [|n IH]; simpl.
    - unfold Rdiv. rewrite !Rmult_0_l. lra.
    - rewrite !plus_IZR. pose proof (reward_R (fst f) (snd f n) (snd f (S n)) Hu). unfold Rdiv in *.
      rewrite !Rmult_plus_distr_r. lra. }
  clear decided planned ok. induction plan as [|f l IH]; simpl.
  - unfold Rdiv. rewrite !Rmult_0_l. lra.
  - rewrite !plus_IZR. specialize (H f). unfold Rdiv in *. rewrite !Rmult_plus_distr_r. lra.
Qed.

Definition flown (f : flight) : Prop :=
  (forall t, (t <= T)%nat -> open I (fst f) t (snd f t) = true)
  /\ (forall t, (t < T)%nat -> In (snd f (S t)) (moves I (fst f) t (snd f t))).

Lemma first_ok (P : state -> bool) (l : list state) s : In s l -> P s = true ->
  reaches (PM.find s (fold_left (fun m s => if P s then lift s 0 m else m) l (PM.empty Z))) 0.
Proof.
  assert (Hold : forall l m, reaches (PM.find s m) 0 ->
    reaches (PM.find s (fold_left (fun m s => if P s then lift s 0 m else m) l m)) 0).
  { induction l0 as [|x l0 IH]; intros m H; simpl; [exact H|]. apply IH. destruct (P x); [apply lift_old|]; exact H. }
  intros Hin HP. generalize (PM.empty Z). induction l as [|x l IH]; intros m; [contradiction|]. simpl.
  destruct Hin as [-> | Hin]; [|apply IH, Hin]. rewrite HP. apply Hold, lift_new.
Qed.

Lemma reach_ok k starts f : In (k, starts) (team I) -> fst f = k -> In (snd f 0%nat) starts -> flown f ->
  Forall2 (fun m j => exists u, PM.find (snd f j) m = Some u) (in_reach k) (seq 0 (S T)).
Proof.
  intros Hd Hk Hs [Ho Hm]. subst k.
  assert (H : Forall2 (fun m j => reaches (PM.find (snd f j) m) (0 + so_far (fun _ _ => 0) (fun _ _ _ => 0) (snd f) j))
                (in_reach (fst f)) (seq 0 (S T))).
  { unfold in_reach. apply forward_ok with (T := T); try assumption; [reflexivity|]. apply first_ok; [|apply Ho; lia].
    unfold starts_of. apply in_flat_map. exists (fst f, starts). split; [|exact Hs].
    apply filter_In. split; [exact Hd | apply Nat.eqb_refl]. }
  clear - H. induction H as [|m j ms js [u [E _]] H IH]; constructor; [exists u; exact E | exact IH].
Qed.

Lemma views_in_reach k Us : forall t n p,
  views_in_reach_ok k t Us = true -> Forall2 (fun m j => exists u, PM.find (p j) m = Some u) Us (seq t n) ->
  forall j, (t <= j < t + n)%nat -> views_ok I M k j (p j) = true.
Proof.
  induction Us as [|U Us IH]; intros t n p H HF j Hj.
  - destruct n; [lia | inversion HF].
  - destruct n as [|n]; [lia|]. simpl seq in HF. apply Forall2_head in HF. destruct HF as [[u Hu] HF].
    simpl in H. apply andb_true_iff in H. destruct H as [H1 H2].
    destruct (Nat.eq_dec j t) as [-> | Hne].
    + rewrite forallb_forall in H1. apply PM.elements_correct in Hu. exact (H1 _ Hu).
    + apply (IH (S t) n p H2 HF j). lia.
Qed.

Lemma best_paths_ok k starts f V : In (k, starts) (team I) -> fst f = k -> In (snd f 0%nat) starts -> flown f ->
  best_paths k = Some V ->
  (forall t, (t <= T)%nat -> views_ok I M k t (snd f t) = true) /\ comes_to V (snd f 0%nat) (path_value f).
Proof.
  intros Hd Hk Hs Hf HV. pose proof (reach_ok k starts f Hd Hk Hs Hf) as HR.
  unfold best_paths in HV. destruct (views_in_reach_ok k 0 (in_reach k)) eqn:Ev; [|discriminate].
  split.
  - intros t Ht. apply (views_in_reach k _ 0 (S T) (snd f) Ev HR). lia.
  - destruct Hf as [Ho Hm]. rewrite Hk in Hm.
    pose proof (backward_ok T (moves I k) (price k) (toll k) (snd f) Hm T 0 (in_reach k) ltac:(lia) HR) as HB.
    destruct (backward _ _ _ 0 (in_reach k)) as [|V' Vs]; [discriminate|]. injection HV as ->.
    simpl seq in HB. apply Forall2_head in HB. destruct HB as [HB _].
    rewrite Nat.sub_0_r in HB. unfold path_value. rewrite Hk.
    rewrite <- (value_split T (price k) (toll k) (snd f) T 0 ltac:(lia)). simpl so_far.
    rewrite Z.add_0_l. exact HB.
Qed.

Lemma best_start_ok V starts s c : In s starts -> comes_to V s c -> reaches (best_start V starts) c.
Proof.
  intros Hin [v [Ev Hv]]. unfold best_start.
  destruct (largest_in (fun s => match PM.find s V with Some v => v | None => None end) starts None s v Hin) as [b [Eb Hb]].
  { rewrite Ev. reflexivity. }
  exists b. split; [exact Eb | lia].
Qed.

Lemma team_best_ok V : forall drones fs,
  Forall2 (fun d f => reaches (best_start (V (fst d)) (snd d)) (path_value f)) drones fs ->
  reaches (team_best V drones) (sumZ (map path_value fs)).
Proof.
  induction 1 as [|[k starts] f ds fs [a [Ea Ha]] H IH]; simpl.
  - exists 0. split; [reflexivity | lia].
  - destruct IH as [b [Eb Hb]]. simpl in Ea. rewrite Ea, Eb. exists (a + b). split; [reflexivity | lia].
Qed.
End Plan.

Theorem bound_sound answer plan :
  bound = Some answer -> is_plan I plan -> Forall (holds I plan) decisions ->
  exists b, answer = Some b /\ (J I plan <= IZR b / IZR (precision M))%R.
Proof.
  unfold bound. intros Hb Hp Hd. destruct numbers_ok eqn:Hok; [|discriminate].
  destruct (all_there (map (fun k => (k, best_paths k)) classes)) as [table|] eqn:Et; [|discriminate].
  injection Hb as <-.
  pose proof (ok_parts Hok) as [Hu [Hg _]].
  destruct (units I M Hu) as [_ [Zu _]]. apply IZR_pos in Zu.
  assert (Hteam : Forall2 (fun d f => (forall t, (t <= T)%nat -> views_ok I M (fst f) t (snd f t) = true)
      /\ reaches (best_start (of_class (PM.empty _) table (fst d)) (snd d)) (path_value f)) (team I) plan).
  { destruct Hp as [HF _].
    assert (Hin : forall d, In d (team I) -> In d (team I)) by auto. revert Hin HF.
    generalize (team I) at 1 3 4 as ds. clear Hd. intros ds. revert ds.
    induction plan as [|f l IH]; intros ds Hin HF; inversion HF as [|d f' ds' fs' [E1 E2] HF']; subst; constructor.
    - destruct d as [k starts], f as [k' p]. simpl in E1, E2. subst k'. destruct E2 as [Hs [Ho Hm]].
      assert (Hd : In (k, starts) (team I)) by (apply Hin; left; reflexivity).
      assert (Hc : In k classes).
      { unfold classes. apply nodup_In. apply in_map_iff. exists (k, starts). auto. }
      pose proof (all_there_in best_paths (PM.empty _) classes table Et k Hc) as EV.
      destruct (best_paths_ok k starts (k, p) _ Hd eq_refl Hs (conj Ho Hm) EV) as [Hv Hcome].
      split; [exact Hv|]. simpl. apply (best_start_ok _ _ (p 0%nat)); assumption.
    - apply IH; [|exact HF']. intros d' Hd'. apply Hin. right. exact Hd'. }
  destruct (team_best_ok (of_class (PM.empty _) table) (team I) plan) as [v [Ev Hv]].
  { clear - Hteam. induction Hteam as [|d f ds fs [_ H] HF IH]; constructor; assumption. }
  rewrite Ev. exists (constants I M + row_constant + v). split; [reflexivity|].
  assert (Hsights : forall f t, In f plan -> (t <= T)%nat -> views_ok I M (fst f) t (snd f t) = true).
  { clear - Hteam. induction Hteam as [|d f ds fs [H _] HF IH]; intros f' t Hin Ht; [contradiction|].
    destruct Hin as [<- | Hin]; [apply H, Ht | apply IH; assumption]. }
  unfold J.
  pose proof (worth_bound I M Hu Hg plan (team_classes plan Hp) (proj2 Hp) Hsights) as HW.
  pose proof (bonuses_R plan Hok) as HB.
  pose proof (paths_together plan Hok Hp Hd) as HP.
  eapply Rle_trans; [apply Rplus_le_compat; [exact HW | exact HB]|].
  rewrite (sum_fractions M). apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat, Zu|].
  apply IZR_le. lia.
Qed.

Theorem check_sound_under numerator denominator plan :
  check numerator denominator = true -> is_plan I plan -> Forall (holds I plan) decisions ->
  (J I plan <= IZR numerator / IZR denominator)%R.
Proof.
  unfold check. intros H Hp Hd. destruct bound as [answer|] eqn:E; [|discriminate].
  destruct (bound_sound answer plan E Hp Hd) as [b [-> HJ]].
  split_andb. to_Z.
  assert (Hu : units_ok I M = true).
  { unfold bound in E. destruct numbers_ok eqn:Hok; [|discriminate]. apply (ok_parts Hok). }
  destruct (units I M Hu) as [_ [Zu _]].
  assert (Hle : b * denominator <= numerator * precision M) by assumption.
  assert (Hden : 0 < denominator) by assumption.
  apply Rle_trans with (1 := HJ). apply IZR_le in Hle. rewrite !mult_IZR in Hle. apply IZR_pos in Zu, Hden.
  apply Rmult_le_reg_r with (IZR denominator * IZR (precision M))%R; [apply Rmult_lt_0_compat; assumption|].
  replace (IZR b / IZR (precision M) * (IZR denominator * IZR (precision M)))%R with (IZR b * IZR denominator)%R by (field; lra).
  replace (IZR numerator / IZR denominator * (IZR denominator * IZR (precision M)))%R with (IZR numerator * IZR (precision M))%R by (field; lra).
  exact Hle.
Qed.
End Checker.

(** * Trees of decisions: of each branch one side holds of every plan *)

(** A leaf has a multiplier for each decision on the way to it, the last decision first. *)
Inductive tree :=
| Proved (C : certificate) (nus : list Z)
| Divided (r : resource) (n : Z) (at_most at_least : tree).

Definition decision : Type := resource * bool * Z.

Fixpoint priced (ds : list decision) (nus : list Z) : list row :=
  match ds, nus with
  | (r, most, n) :: ds', nu :: nus' => Row r most n nu :: priced ds' nus'
  | _, _ => []
  end.

Fixpoint check_tree (I : instance) (ds : list decision) (tr : tree) (num den : Z) : bool :=
  match tr with
  | Proved C nus => check I C (priced ds nus) num den
  | Divided r n a b => check_tree I ((r, true, n) :: ds) a num den
                      && check_tree I ((r, false, n + 1) :: ds) b num den
  end.

Definition obeys (I : instance) (plan : list flight) (d : decision) : Prop :=
  let '(r, most, n) := d in if (most : bool) then plan_uses I r plan <= n else n <= plan_uses I r plan.

Lemma priced_holds I plan : forall ds nus, Forall (obeys I plan) ds -> Forall (holds I plan) (priced ds nus).
Proof.
  induction ds as [|[[r most] n] ds IH]; intros [|nu nus] H; simpl; try constructor.
  - apply Forall_cons_iff in H. destruct H as [H _]. unfold obeys in H. unfold holds, sign. simpl. destruct most; lia.
  - apply Forall_cons_iff in H. apply IH, H.
Qed.

Lemma check_tree_sound I num den plan : forall tr ds,
  check_tree I ds tr num den = true -> is_plan I plan -> Forall (obeys I plan) ds ->
  (J I plan <= IZR num / IZR den)%R.
Proof.
  induction tr as [C nus | r n a IHa b IHb]; intros ds H Hp Hd; simpl in H.
  - apply (check_sound_under I C _ num den plan H Hp). apply priced_holds. exact Hd.
  - apply andb_true_iff in H. destruct H as [Ha Hb].
    destruct (Z_le_gt_dec (plan_uses I r plan) n) as [L | G].
    + apply (IHa _ Ha Hp). constructor; [exact L | exact Hd].
    + apply (IHb _ Hb Hp). constructor; [unfold obeys; lia | exact Hd].
Qed.

(** A claim that passes the check is true. *)
Theorem tree_sound I tr num den plan :
  check_tree I [] tr num den = true -> is_plan I plan -> (J I plan <= IZR num / IZR den)%R.
Proof. intros H Hp. apply (check_tree_sound I num den plan tr [] H Hp). constructor. Qed.
