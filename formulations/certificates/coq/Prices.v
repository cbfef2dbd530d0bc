(** What drones are paid for what they see, and the constants that go with it: whole numbers. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz.
From CocapCheck Require Import Spec Sums Returns.
Import ListNotations.
Open Scope Z_scope.

(** A share of a root is bounded by a constant and functions of what each drone has, which are
    given by points (root, value) for each class: all in 1/scale. *)
Record cut := Cut { share : Z; constant : Z; curves : list (nat * list (Z * Z)) }.

(** Of a group: alpha and beta in 1/scale, the constant in 1/precision, and its step. *)
Record group_prices := GroupPrices {
  alpha : Z; beta : Z; kappa : Z; cuts : list cut; at_step : nat }.

Record multipliers := Multipliers {
  scale : Z;
  precision : Z;
  over_time : bool;  (* a group is seen at more than one step *)
  prices : group -> group_prices }.

Fixpoint curve_in (cs : list (nat * list (Z * Z))) (k : nat) : list (Z * Z) :=
  match cs with
  | [] => []
  | (k', points) :: rest => if Nat.eqb k k' then points else curve_in rest k
  end.

Section Prices.
Variables (I : instance) (M : multipliers).

(** A root of an amount, rounded up, in 1/scale.  It is looked for, and used if it is none too low. *)
Definition root_of (c : Z) : Z :=
  if c =? 0 then 0 else
  let square := c * (scale M * scale M) in
  let root := Z.sqrt_up (cdiv square (amount_unit I)) in
  if (0 <=? root) && (square <=? root * root * amount_unit I) then root else scale M * (c + 1).

Definition cut_pay (k : nat) (root : Z) (c : cut) : Z := share c * phi 0 0 (curve_in (curves c) k) root.

(** The payment for a view, in 1/pay_unit. *)
Definition pay (k : nat) (v : group * Z) : Z :=
  let (g, c) := v in
  let p := prices M g in
  let root := root_of c in
  weight I g * (amount_unit I * (alpha p * root + sumZ (map (cut_pay k root) (cuts p)))
                + scale M * (beta p * c)).

Definition pay_unit : Z := scale M * scale M * amount_unit I * weight_unit I.

(** The payment for all views of a state, rounded up to 1/precision. *)
Definition paid (k t : nat) (s : state) : Z :=
  cdiv (precision M * sumZ (map (pay k) (sees I k t s))) pay_unit.

Definition view_ok (k t : nat) (v : group * Z) : bool :=
  (0 <=? snd v) && (0 <=? pay k v) && (over_time M || Nat.eqb (at_step (prices M (fst v))) t).

Fixpoint increasing (vs : list (group * Z)) : bool :=
  match vs with
  | v :: ((w :: _) as rest) => Pos.ltb (fst v) (fst w) && increasing rest
  | _ => true
  end.

Definition views_ok (k t : nat) (s : state) : bool :=
  increasing (sees I k t s) && forallb (view_ok k t) (sees I k t s).

(** * Cuts: the constant is enough at all corners *)

Definition size (k : nat) : nat := length (filter (fun d => Nat.eqb k (fst d)) (team I)).

(** Up to n drones of a class stand at its points, all others at (0, 0). *)
Fixpoint take (n : nat) (points : list (Z * Z)) (q paid : Z) (next : Z -> Z -> bool) : bool :=
  match points with
  | [] => next q paid
  | (b, v) :: rest =>
      forallb (fun j => take (n - j) rest (q + Z.of_nat j * (b * b)) (paid + Z.of_nat j * v) next)
              (seq 0 (S n))
  end.

Fixpoint corners_ok (enough : Z) (cs : list (nat * list (Z * Z))) (q paid : Z) : bool :=
  match cs with
  | [] => (0 <=? enough + paid) && (q <=? (enough + paid) * (enough + paid))
  | (k, points) :: rest => take (size k) points q paid (corners_ok enough rest)
  end.

Definition cut_ok (c : cut) : bool :=
  (0 <=? share c) && (0 <=? constant c)
  && forallb (fun kp => rising 0 (snd kp)) (curves c) && corners_ok (constant c) (curves c) 0 0.

Definition group_ok (g : group) : bool :=
  let p := prices M g in
  let w := weight I g in
  (0 <=? w) && (0 <=? alpha p) && (0 <=? beta p) && (0 <=? kappa p) &&
  match return_by I g, cuts p with
  | AtMost k, [] =>
      (0 <=? k) && (w * k * Z.max 0 (scale M - beta p) * precision M <=? kappa p * (weight_unit I * scale M))
  | AtMost _, _ => false
  | Root, cs =>
      let rest := scale M - sumZ (map share cs) in
      let by_cuts := sumZ (map (fun c => share c * constant c) cs) in
      let most := kappa p * weight_unit I * (scale M * scale M) in
      (negb (over_time M) || match cs with [] => true | _ => false end)
      && forallb cut_ok cs
      && (((rest <=? alpha p) && (w * precision M * by_cuts <=? most))
          || ((0 <? beta p)
              && (w * precision M * ((rest - alpha p) * (rest - alpha p) * scale M + 4 * beta p * by_cuts)
                  <=? 4 * beta p * most)))
  end.

Definition units_ok : bool :=
  (0 <? scale M) && (0 <? precision M) && (0 <? amount_unit I) && (0 <? weight_unit I).

(** * Soundness *)

Hypothesis positive_units : units_ok = true.

Lemma units : 0 < scale M /\ 0 < precision M /\ 0 < amount_unit I /\ 0 < weight_unit I.
Proof. pose proof positive_units as H. unfold units_ok in H. split_andb. to_Z. auto. Qed.

Lemma pay_unit_pos : 0 < pay_unit.
Proof. destruct units as [? [? [? ?]]]. unfold pay_unit. repeat apply Z.mul_pos_pos; assumption. Qed.

Ltac real_units :=
  destruct units as [Zs [Zu [Za Zw]]];
  pose proof (IZR_pos _ Zs) as Ps; pose proof (IZR_pos _ Zu) as Pu;
  pose proof (IZR_pos _ Za) as Pa; pose proof (IZR_pos _ Zw) as Pw.

Lemma root_of_ok c : 0 <= c ->
  (0 <= sqrt (IZR c / IZR (amount_unit I)) * IZR (scale M) <= IZR (root_of c))%R.
Proof.
  intros Hc. real_units. pose proof (sqrt_pos (IZR c / IZR (amount_unit I))) as Hp.
  split; [apply Rmult_le_pos; lra|].
  pose proof (frac_nonneg c _ Hc Za) as Hf.
  set (x := (IZR c / IZR (amount_unit I))%R) in *.
  assert (Ex : (x * IZR (amount_unit I) = IZR c)%R) by (unfold x; field; lra).
  assert (K : forall r, 0 <= r -> c * (scale M * scale M) <= r * r * amount_unit I ->
                (sqrt x * IZR (scale M) <= IZR r)%R).
  { intros r Hr H. apply IZR_le in H. rewrite !mult_IZR in H.
    apply Rsqr_incr_0_var; [|apply IZR_nonneg; exact Hr]. unfold Rsqr.
    replace (sqrt x * IZR (scale M) * (sqrt x * IZR (scale M)))%R
      with (sqrt x * sqrt x * (IZR (scale M) * IZR (scale M)))%R by ring.
    rewrite sqrt_sqrt by exact Hf. apply Rmult_le_reg_r with (IZR (amount_unit I)); [lra|].
    rewrite <- Ex in H. lra. }
  unfold root_of. destruct (c =? 0) eqn:E0.
  - to_Z. apply K; [lia|]. subst. lia.
  - cbv zeta. match goal with |- context [if ?b then _ else _] => destruct b eqn:E end.
    + split_andb. to_Z. apply K; assumption.
    + apply K; [nia|]. replace (scale M * (c + 1) * (scale M * (c + 1)) * amount_unit I)
        with ((scale M * scale M) * ((c + 1) * (c + 1) * amount_unit I)) by ring.
      rewrite Z.mul_comm. apply Z.mul_le_mono_nonneg_l; nia.
Qed.

Lemma root_of_0 : root_of 0 = 0.
Proof. reflexivity. Qed.

Lemma phi_0 points : phi 0 0 points 0 = 0 \/ rising 0 points = false.
Proof.
  destruct points as [|[r v] rest]; simpl; [left; lia|].
  destruct (Z.ltb_spec 0 r); [|right; reflexivity].
  left. replace (0 <=? r) with true by (symmetry; apply Z.leb_le; lia). reflexivity.
Qed.

Definition squares (l : list (Z * Z)) : Z := sumZ (map (fun c => fst c * fst c) l).
Definition values (l : list (Z * Z)) : Z := sumZ (map snd l).

Lemma zeros l : (forall x, In x l -> x = (0, 0)) -> squares l = 0 /\ values l = 0.
Proof.
  intros H. split; apply sumZ_zero; intros x Hx; rewrite (H x Hx); reflexivity.
Qed.

Definition same (x y : Z * Z) : bool := (fst x =? fst y) && (snd x =? snd y).

Lemma same_eq x y : same x y = true -> y = x.
Proof. destruct x, y. unfold same. simpl. intros H. split_andb. to_Z. congruence. Qed.

Lemma sum_of_same f x l : sumZ (map f (filter (same x) l)) = Z.of_nat (length (filter (same x) l)) * f x.
Proof.
  induction l as [|y l IH]; [reflexivity|]. cbn [filter].
  destruct (same x y) eqn:E; [|exact IH]. apply same_eq in E. subst y.
  cbn [map sumZ length]. rewrite IH, Nat2Z.inj_succ. lia.
Qed.

Lemma filter_lengths {A} (b : A -> bool) l :
  (length (filter b l) + length (filter (fun x => negb (b x)) l) = length l)%nat.
Proof. induction l as [|x l IH]; simpl; [reflexivity|]. destruct (b x); simpl; lia. Qed.

Lemma take_sound points : forall n q p next l,
  take n points q p next = true -> (length l <= n)%nat ->
  (forall x, In x l -> In x ((0, 0) :: points)) -> next (q + squares l) (p + values l) = true.
Proof.
  induction points as [|[b v] points IH]; intros n q p next l H Hlen Hl.
  - simpl in H. destruct (zeros l) as [-> ->].
    + intros x Hx. destruct (Hl x Hx) as [E | []]. auto.
    + rewrite !Z.add_0_r. exact H.
  - cbn [take] in H. rewrite forallb_forall in H.
    set (same_ones := filter (same (b, v)) l). set (others := filter (fun x => negb (same (b, v) x)) l).
    pose proof (filter_lengths (same (b, v)) l) as HL. fold same_ones others in HL.
    specialize (H (length same_ones)). rewrite in_seq in H.
    specialize (IH _ _ _ _ others (H ltac:(lia))).
    replace (q + squares l) with (q + Z.of_nat (length same_ones) * (b * b) + squares others).
    2:{ unfold squares. rewrite (sumZ_filter (same (b, v)) _ l). fold same_ones others.
        unfold same_ones at 2. rewrite sum_of_same. fold same_ones. cbn [fst]. lia. }
    replace (p + values l) with (p + Z.of_nat (length same_ones) * v + values others).
    2:{ unfold values. rewrite (sumZ_filter (same (b, v)) _ l). fold same_ones others.
        unfold same_ones at 2. rewrite sum_of_same. fold same_ones. cbn [snd]. lia. }
    apply IH; [lia|]. intros x Hx. apply filter_In in Hx. destruct Hx as [Hx E].
    destruct (Hl x Hx) as [D | [D | D]]; [left; exact D | | right; exact D].
    exfalso. subst x. unfold same in E. simpl in E. rewrite !Z.eqb_refl in E. discriminate.
Qed.

Lemma corners_sound enough cs : forall q p (l : list (nat * (Z * Z))),
  corners_ok enough cs q p = true ->
  (forall x, In x l -> In (snd x) ((0, 0) :: curve_in cs (fst x))) ->
  (forall k, (length (filter (fun x => Nat.eqb k (fst x)) l) <= size k)%nat) ->
  0 <= enough + (p + values (map snd l))
  /\ q + squares (map snd l) <= (enough + (p + values (map snd l))) * (enough + (p + values (map snd l))).
Proof.
  induction cs as [|[k points] cs IH]; intros q p l H Hl Hn.
  - simpl in H. split_andb. to_Z. destruct (zeros (map snd l)) as [-> ->].
    + intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
      destruct (Hl y Hy) as [E | []]. auto.
    + rewrite !Z.add_0_r. auto.
  - cbn [corners_ok] in H.
    set (mine := filter (fun x => Nat.eqb k (fst x)) l).
    set (others := filter (fun x => negb (Nat.eqb k (fst x))) l).
    apply (take_sound points _ _ _ _ (map snd mine)) in H.
    + apply (IH _ _ others) in H.
      * replace (q + squares (map snd l)) with (q + squares (map snd mine) + squares (map snd others)).
        2:{ unfold squares. rewrite !map_map, (sumZ_filter (fun x => Nat.eqb k (fst x)) _ l).
            fold mine others. lia. }
        replace (p + values (map snd l)) with (p + values (map snd mine) + values (map snd others)).
        2:{ unfold values. rewrite !map_map, (sumZ_filter (fun x => Nat.eqb k (fst x)) _ l).
            fold mine others. lia. }
        exact H.
      * intros x Hx. apply filter_In in Hx. destruct Hx as [Hx E]. specialize (Hl x Hx).
        cbn [curve_in] in Hl. destruct (Nat.eqb_spec (fst x) k) as [He | Hne]; [|exact Hl].
        exfalso. rewrite He, Nat.eqb_refl in E. discriminate.
      * intros k'. eapply Nat.le_trans; [|apply (Hn k')]. unfold others. clear.
        induction l as [|x l IH]; simpl; [lia|].
        destruct (Nat.eqb k (fst x)), (Nat.eqb k' (fst x)) eqn:E; simpl; rewrite ?E; simpl; lia.
    + rewrite map_length. apply Hn.
    + intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
      apply filter_In in Hy. destruct Hy as [Hy E]. specialize (Hl y Hy).
      apply Nat.eqb_eq in E. cbn [curve_in] in Hl. rewrite <- E, Nat.eqb_refl in Hl. exact Hl.
Qed.

(** What a group is seen of by some drones: class and amount. *)
Definition views := list (nat * Z).
Definition all_nonneg (vs : views) := forall x, In x vs -> 0 <= snd x.
Definition parts (vs : views) : list R := map (fun x => IZR (snd x) / IZR (amount_unit I))%R vs.

Lemma parts_nonneg vs : all_nonneg vs -> nonneg (parts vs).
Proof.
  intros H. unfold nonneg, parts. apply Forall_forall. intros x Hx. apply in_map_iff in Hx.
  destruct Hx as [y [<- Hy]]. apply frac_nonneg; [apply H; exact Hy | apply units].
Qed.

Lemma parts_sum vs : sumR (parts vs) = (IZR (sumZ (map snd vs)) / IZR (amount_unit I))%R.
Proof.
  real_units. unfold parts. rewrite IZR_sumZ. unfold Rdiv at 2.
  rewrite Rmult_comm, <- sumR_scale. apply sumR_ext. intros. unfold Rdiv. ring.
Qed.

Lemma cut_bound c vs : cut_ok c = true -> all_nonneg vs -> map fst vs = map fst (team I) ->
  (sqrt (sumR (parts vs)) * IZR (scale M)
   <= IZR (constant c) + IZR (sumZ (map (fun x => phi 0 0 (curve_in (curves c) (fst x)) (root_of (snd x))) vs)))%R.
Proof.
  intros Hc Hvs Hteam. real_units. unfold cut_ok in Hc. split_andb. to_Z.
  set (item := fun x : nat * Z => (sqrt (IZR (snd x) / IZR (amount_unit I)) * IZR (scale M),
                 root_of (snd x), curve_in (curves c) (fst x))%R).
  assert (Hitems : Forall item_ok (map item vs)).
  { apply Forall_forall. intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
    split; [apply root_of_ok, Hvs, Hy|].
    match goal with H : forallb _ (curves c) = true |- _ => rename H into HR end.
    clear - HR. induction (curves c) as [|[k' pts] cs IH]; [reflexivity|].
    simpl in HR. split_andb. simpl. destruct (Nat.eqb (fst y) k'); auto. }
  destruct (corners_exist _ 0 Hitems (Rle_refl 0)) as [cs [Hcs Hle]].
  assert (Es : (sqrt (0 + sumR (map squared (map item vs))) = sqrt (sumR (parts vs)) * IZR (scale M))%R).
  { replace (0 + sumR (map squared (map item vs)))%R
      with (sumR (parts vs) * (IZR (scale M) * IZR (scale M)))%R.
    - rewrite sqrt_mult_alt by (apply sumR_nonneg, parts_nonneg, Hvs).
      rewrite sqrt_square by lra. reflexivity.
    - rewrite Rplus_0_l, Rmult_comm. unfold parts. rewrite <- sumR_scale, map_map. apply sumR_ext.
      intros x Hx. simpl.
      pose proof (frac_nonneg _ _ (Hvs x Hx) Za) as Hf. pose proof (sqrt_sqrt _ Hf) as Hq.
      rewrite <- Hq at 1. ring. }
  rewrite Es, map_map in Hle. simpl in Hle.
  (* the corners, with the class of each drone *)
  set (l := combine (map fst vs) cs).
  assert (Hlen : length vs = length cs).
  { apply Forall2_lengths in Hcs. rewrite map_length in Hcs. exact Hcs. }
  assert (Esnd : map snd l = cs).
  { unfold l. clear - Hlen. revert cs Hlen. induction vs as [|x vs IH]; intros [|y cs] H; simpl in *;
      try discriminate; [reflexivity|]. f_equal. apply IH. lia. }
  assert (Efst : map fst l = map fst (team I)).
  { rewrite <- Hteam. unfold l. clear - Hlen. revert cs Hlen. induction vs as [|x vs IH]; intros [|y cs] H; simpl in *;
      try discriminate; [reflexivity|]. f_equal. apply IH. lia. }
  assert (C1 : forall x, In x l -> In (snd x) ((0, 0) :: curve_in (curves c) (fst x))).
  { intros x Hx. unfold l in Hx. clear - Hcs Hx. revert cs Hcs Hx.
    induction vs as [|y vs IH]; intros [|z cs] Hcs Hx; simpl in *; try contradiction.
    apply Forall2_head in Hcs. destruct Hcs as [Hc Hcs]. destruct Hx as [<- | Hx]; [exact Hc|].
    exact (IH cs Hcs Hx). }
  assert (C2 : forall k, (length (filter (fun x => Nat.eqb k (fst x)) l) <= size k)%nat).
  { intros k. unfold size. apply Nat.eq_le_incl.
    assert (E : forall A (m : list (nat * A)), length (filter (fun x => Nat.eqb k (fst x)) m)
                 = length (filter (Nat.eqb k) (map fst m))).
    { clear. intros A m. induction m as [|x m IH]; simpl; [reflexivity|].
      destruct (Nat.eqb k (fst x)); simpl; congruence. }
    rewrite !E, Efst. reflexivity. }
  assert (C3 : corners_ok (constant c) (curves c) 0 0 = true) by assumption.
  destruct (corners_sound _ _ _ _ l C3 C1 C2) as [C4 C5].
  rewrite Esnd, !Z.add_0_l in C4, C5.
  apply IZR_le in C5. rewrite mult_IZR in C5. apply IZR_nonneg in C4.
  assert (HS : (sqrt (0 + IZR (squares cs)) <= IZR (constant c + values cs))%R).
  { rewrite Rplus_0_l. rewrite <- (sqrt_square (IZR (constant c + values cs))) by exact C4.
    apply sqrt_le_1_alt. exact C5. }
  rewrite plus_IZR in HS. unfold squares, values in HS. lra.
Qed.

(** The inequality of a group: its worth is at most what its viewers are paid and its constant. *)
Lemma group_bound g vs : group_ok g = true -> all_nonneg vs ->
  (over_time M = true \/ map fst vs = map fst (team I)) ->
  (worth I g (sumZ (map snd vs))
   <= IZR (sumZ (map (fun x => pay (fst x) (g, snd x)) vs)) / IZR pay_unit
      + IZR (kappa (prices M g)) / IZR (precision M))%R.
Proof.
  intros Hg Hvs Hteam. real_units. unfold group_ok in Hg.
  pose proof (parts_nonneg vs Hvs) as Hn. pose proof (parts_sum vs) as Hsum.
  set (p := prices M g) in *. set (w := weight I g) in *.
  apply andb_true_iff in Hg; destruct Hg as [Hg Hcase].
  split_andb. to_Z.
  assert (Zw0 : 0 <= w) by assumption. assert (Za0 : 0 <= alpha p) by assumption.
  assert (Zb0 : 0 <= beta p) by assumption. assert (Zk0 : 0 <= kappa p) by assumption.
  set (W := (IZR w / IZR (weight_unit I))%R).
  assert (HW : (0 <= W)%R) by (apply frac_nonneg; assumption).
  set (A := (IZR (alpha p) / IZR (scale M))%R). set (B := (IZR (beta p) / IZR (scale M))%R).
  assert (HA : (0 <= A)%R) by (apply frac_nonneg; assumption).
  assert (HB : (0 <= B)%R) by (apply frac_nonneg; assumption).
  assert (HK : (0 <= IZR (kappa p) / IZR (precision M))%R) by (apply frac_nonneg; assumption).
  set (phis := fun c => sumZ (map (fun x => phi 0 0 (curve_in (curves c) (fst x)) (root_of (snd x))) vs)).
  set (roots := sumZ (map (fun x => root_of (snd x)) vs)).
  (* what is paid, as a real *)
  assert (Epay : (IZR (sumZ (map (fun x => pay (fst x) (g, snd x)) vs)) / IZR pay_unit
    = W * (A * (IZR roots / IZR (scale M)) + B * sumR (parts vs)
           + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (phis c) / IZR (scale M))) (cuts p))))%R).
  { assert (E : sumZ (map (fun x => pay (fst x) (g, snd x)) vs)
        = w * (amount_unit I * (alpha p * roots + sumZ (map (fun c => share c * phis c) (cuts p)))
               + scale M * (beta p * sumZ (map snd vs)))).
    { unfold pay. fold p w. rewrite sumZ_scale. f_equal. rewrite sumZ_add, !sumZ_scale. f_equal. f_equal.
      rewrite sumZ_add, sumZ_scale. f_equal. rewrite sumZ_swap. apply sumZ_ext. intros c Hc.
      unfold cut_pay, phis. rewrite sumZ_scale. reflexivity. }
    rewrite E, Hsum. clear E.
    replace (sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (phis c) / IZR (scale M))) (cuts p))%R)
      with (IZR (sumZ (map (fun c => share c * phis c)%Z (cuts p))) / (IZR (scale M) * IZR (scale M)))%R.
    2:{ rewrite IZR_sumZ. unfold Rdiv at 1. rewrite Rmult_comm, <- sumR_scale. apply sumR_ext.
        intros c _. rewrite mult_IZR. field. lra. }
    unfold pay_unit, W, A, B. rewrite !mult_IZR, !plus_IZR, !mult_IZR, plus_IZR, !mult_IZR. field. repeat split; lra. }
  rewrite Epay. clear Epay.
  assert (Hroots : (sumR (map sqrt (parts vs)) <= IZR roots / IZR (scale M))%R).
  { unfold parts, roots. rewrite map_map, IZR_sumZ. unfold Rdiv at 2. rewrite Rmult_comm, <- sumR_scale.
    apply sumR_le. intros x Hx. destruct (root_of_ok (snd x) (Hvs x Hx)) as [_ HR1].
    apply Rmult_le_reg_r with (IZR (scale M)); [lra|]. rewrite (Rmult_comm (/ _)), Rmult_assoc, Rinv_l by lra. lra. }
  unfold worth. fold w W. rewrite <- Hsum.
  destruct (return_by I g) as [|k] eqn:Er.
  - (* a root *)
    split_andb. simpl return_value.
    set (rest := scale M - sumZ (map share (cuts p))) in *.
    set (by_cuts := sumZ (map (fun c => share c * constant c) (cuts p))) in *.
    set (REST := (IZR rest / IZR (scale M))%R).
    set (CUTS := (IZR by_cuts / (IZR (scale M) * IZR (scale M)))%R).
    assert (Hcuts : forall c, In c (cuts p) -> cut_ok c = true).
    { match goal with H : forallb cut_ok _ = true |- _ => rewrite forallb_forall in H; exact H end. }
    assert (Hover : over_time M = false \/ cuts p = []).
    { destruct (over_time M); [|left; reflexivity]. right. destruct (cuts p); [reflexivity | discriminate]. }
    set (r := sqrt (sumR (parts vs))) in *.
    assert (Hr : (0 <= r)%R) by apply sqrt_pos.
    assert (Hcut : ((1 - REST) * r <= CUTS
       + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (phis c) / IZR (scale M))) (cuts p)))%R).
    { assert (E1 : (1 - REST = sumR (map (fun c => IZR (share c) / IZR (scale M)) (cuts p)))%R).
      { unfold REST, rest. rewrite minus_IZR, IZR_sumZ.
        replace (sumR (map (fun c => IZR (share c) / IZR (scale M)) (cuts p))%R)
          with (/ IZR (scale M) * sumR (map (fun c => IZR (share c)) (cuts p)))%R.
        2:{ rewrite <- sumR_scale. apply sumR_ext. intros. unfold Rdiv. ring. }
        field. lra. }
      assert (E2 : (CUTS = sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (constant c) / IZR (scale M))) (cuts p)))%R).
      { unfold CUTS, by_cuts. rewrite IZR_sumZ. unfold Rdiv at 1. rewrite Rmult_comm, <- sumR_scale.
        apply sumR_ext. intros. rewrite mult_IZR. field. lra. }
      rewrite E1, E2, <- sumR_add, Rmult_comm, <- sumR_scale. apply sumR_le. intros c Hc.
      pose proof (Hcuts c Hc) as Hok.
      assert (Hsh : 0 <= share c) by (unfold cut_ok in Hok; split_andb; to_Z; assumption).
      pose proof (frac_nonneg _ _ Hsh Zs) as Hshare.
      rewrite <- Rmult_plus_distr_l, Rmult_comm. apply Rmult_le_compat_l; [exact Hshare|].
      destruct Hteam as [Ho | Ht].
      { exfalso. destruct Hover as [Ho' | Hn']; [congruence | rewrite Hn' in Hc; contradiction]. }
      pose proof (cut_bound c vs Hok Hvs Ht) as CB. fold r in CB. fold (phis c) in CB.
      apply Rmult_le_reg_r with (IZR (scale M)); [lra|].
      rewrite Rmult_plus_distr_r. unfold Rdiv. rewrite !Rmult_assoc, !Rinv_l by lra. lra. }
    (* the share that is left to alpha and beta *)
    assert (Hby : 0 <= by_cuts).
    { unfold by_cuts. apply sumZ_nonneg. intros c Hc. pose proof (Hcuts c Hc) as Hok.
      unfold cut_ok in Hok. split_andb. to_Z. apply Z.mul_nonneg_nonneg; assumption. }
    assert (HCUTS : (0 <= CUTS)%R).
    { unfold CUTS. apply Rmult_le_pos; [apply IZR_nonneg; exact Hby|].
      apply Rlt_le, Rinv_0_lt_compat, Rmult_lt_0_compat; lra. }
    assert (Hrest : exists K, (0 <= K)%R /\ (REST * r <= A * sumR (map sqrt (parts vs)) + B * sumR (parts vs) + K)%R
                              /\ (W * (K + CUTS) <= IZR (kappa p) / IZR (precision M))%R).
    { match goal with H : _ || _ = true |- _ => apply orb_true_iff in H; destruct H as [HO | HO] end; split_andb; to_Z.
      - exists 0%R. split; [lra|]. split.
        + apply root_bound; try assumption; [lra|]. left. unfold REST, A.
          match goal with H : rest <= alpha p |- _ => apply IZR_le in H end.
          unfold Rdiv. apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat; lra | assumption].
        + match goal with H : w * precision M * by_cuts <= _ |- _ => apply IZR_le in H; rewrite !mult_IZR in H; rename H into HX end.
          rewrite Rplus_0_l. unfold W, CUTS.
          apply Rmult_le_reg_r with (IZR (precision M) * (IZR (weight_unit I) * (IZR (scale M) * IZR (scale M))))%R.
          { repeat apply Rmult_lt_0_compat; lra. }
          match goal with |- (?a <= ?b)%R => replace a with (IZR w * IZR (precision M) * IZR by_cuts)%R by (field; lra);
            replace b with (IZR (kappa p) * IZR (weight_unit I) * (IZR (scale M) * IZR (scale M)))%R by (field; lra) end.
          exact HX.
      - assert (Zb : 0 < beta p) by assumption.
        pose proof (IZR_pos _ Zb) as Pb.
        exists ((REST - A) * (REST - A) / (4 * B))%R.
        assert (HB' : (0 < B)%R) by (unfold B; apply Rmult_lt_0_compat; [lra | apply Rinv_0_lt_compat; lra]).
        assert (HK0 : (0 <= (REST - A) * (REST - A) / (4 * B))%R).
        { apply Rmult_le_pos; [apply Rle_0_sqr | apply Rlt_le, Rinv_0_lt_compat; lra]. }
        split; [exact HK0|]. split.
        + apply root_bound; try assumption. right. split; [exact HB'|].
          apply Req_le. field. lra.
        + match goal with H : w * precision M * (_ + _) <= _ |- _ => apply IZR_le in H;
            rewrite !mult_IZR, plus_IZR, !mult_IZR, minus_IZR in H; rename H into HX end.
          unfold W, CUTS, REST, A, B.
          apply Rmult_le_reg_r with (IZR (precision M) * (4 * IZR (beta p) * (IZR (weight_unit I) * (IZR (scale M) * IZR (scale M)))))%R.
          { repeat apply Rmult_lt_0_compat; lra. }
          match goal with |- (?a <= ?b)%R =>
            replace a with (IZR w * IZR (precision M) * ((IZR rest - IZR (alpha p)) * (IZR rest - IZR (alpha p)) * IZR (scale M)
                            + 4 * IZR (beta p) * IZR by_cuts))%R by (field; lra);
            replace b with (4 * IZR (beta p) * (IZR (kappa p) * IZR (weight_unit I) * (IZR (scale M) * IZR (scale M))))%R by (field; lra) end.
          exact HX. }
    destruct Hrest as [K [HK0 [HR HKW]]].
    apply Rle_trans with (W * (A * (IZR roots / IZR (scale M)) + B * sumR (parts vs)
       + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (phis c) / IZR (scale M)))%R (cuts p)) + (K + CUTS)))%R.
    + apply Rmult_le_compat_l; [exact HW|].
      assert (A * sumR (map sqrt (parts vs)) <= A * (IZR roots / IZR (scale M)))%R by (apply Rmult_le_compat_l; assumption).
      lra.
    + rewrite (Rmult_plus_distr_l W). lra.
  - (* a count *)
    destruct (cuts p) as [|c cs] eqn:Ec; [|discriminate]. simpl sumR. split_andb. to_Z. simpl return_value.
    assert (Zk : 0 <= k) by assumption.
    match goal with H : w * k * _ * _ <= _ |- _ => apply IZR_le in H; rewrite !mult_IZR in H; rename H into HX end.
    set (gap := Z.max 0 (scale M - beta p)) in *.
    assert (Hgap0 : 0 <= gap) by (unfold gap; lia). assert (Hgap1 : scale M - beta p <= gap) by (unfold gap; lia).
    apply IZR_le in Hgap0, Hgap1. rewrite minus_IZR in Hgap1.
    pose proof (IZR_nonneg _ Zk) as Hk.
    set (GAP := (IZR gap / IZR (scale M))%R).
    assert (HGAP : (1 - B <= GAP)%R).
    { unfold GAP, B. apply Rmult_le_reg_r with (IZR (scale M)); [lra|].
      unfold Rdiv. rewrite Rmult_minus_distr_r, !Rmult_assoc, !Rinv_l by lra. lra. }
    assert (HGAP0 : (0 <= GAP)%R).
    { unfold GAP. apply Rmult_le_pos; [lra | apply Rlt_le, Rinv_0_lt_compat; lra]. }
    pose proof (count_bound (sumR (parts vs)) (IZR k) B (IZR k * GAP) (sumR_nonneg _ Hn) Hk HB
       ltac:(apply Rmult_le_pos; assumption) ltac:(apply Rmult_le_compat_l; assumption)) as CB.
    assert (HAr : (0 <= A * (IZR roots / IZR (scale M)))%R).
    { apply Rmult_le_pos; [exact HA|]. eapply Rle_trans; [|exact Hroots].
      apply sumR_nonneg. apply Forall_forall. intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- _]]. apply sqrt_pos. }
    assert (HKW : (W * (IZR k * GAP) <= IZR (kappa p) / IZR (precision M))%R).
    { unfold W, GAP.
      apply Rmult_le_reg_r with (IZR (precision M) * (IZR (weight_unit I) * IZR (scale M)))%R.
      { repeat apply Rmult_lt_0_compat; lra. }
      match goal with |- (?a <= ?b)%R => replace a with (IZR w * IZR k * IZR gap * IZR (precision M))%R by (field; lra);
        replace b with (IZR (kappa p) * (IZR (weight_unit I) * IZR (scale M)))%R by (field; lra) end.
      exact HX. }
    apply Rle_trans with (W * (A * (IZR roots / IZR (scale M)) + B * sumR (parts vs) + 0 + IZR k * GAP))%R.
    + apply Rmult_le_compat_l; [exact HW|]. lra.
    + rewrite (Rmult_plus_distr_l W). lra.
Qed.

End Prices.
