(** What drones are paid for what they see, and the constants that go with it: whole numbers. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation Mergesort Orders.
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

(** More pixels come first; among as many, less that is paid. *)
Module Better <: TotalLeBool.
  Definition t := (Z * Z)%type.
  Definition leb (a b : t) : bool := (fst b <? fst a) || ((fst a =? fst b) && (snd a <=? snd b)).
  Theorem leb_total : forall a b, leb a b = true \/ leb b a = true.
  Proof. intros [a p] [b q]. unfold leb. cbn [fst snd]. rewrite !orb_true_iff, !andb_true_iff. lia. Qed.
End Better.
Module Sorting := Sort Better.

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

(** At a slope, a point is worth b^2 - 2 x v: of some points the most, or 0, and the value there. *)
Fixpoint best_at (x : Z) (points : list (Z * Z)) : Z * Z :=
  match points with
  | [] => (0, 0)
  | (b, v) :: rest =>
      let (most, value) := best_at x rest in
      let here := b * b - 2 * x * v in
      if most <? here then (here, v) else (most, value)
  end.

(** The same of n drones at some points, and of all drones of some classes. *)
Fixpoint all_best_at (x : Z) (cs : list (nat * list (Z * Z))) : Z * Z :=
  match cs with
  | [] => (0, 0)
  | (k, points) :: rest =>
      let (most, value) := best_at x points in
      let (mosts, values) := all_best_at x rest in
      (Z.of_nat (size k) * most + mosts, Z.of_nat (size k) * value + values)
  end.

(** All that follows has q' <= y'^2 for y' = enough + paid', as 2 x y' - x^2 <= y'^2 for each x.
    An x that shows it is looked for by bisection. *)
Fixpoint slope_found (fuel : nat) (enough low high : Z) (n : nat) (points : list (Z * Z))
    (cs : list (nat * list (Z * Z))) (q paid : Z) : bool :=
  let x := (low + high) / 2 in
  let (most, value) := best_at x points in
  let (mosts, values) := all_best_at x cs in
  ((0 <? x) && (0 <=? q) && (q + (Z.of_nat n * most + mosts) <=? 2 * x * (enough + paid) - x * x))
  || match fuel with
     | O => false
     | S fuel' =>
         if x <? enough + paid + (Z.of_nat n * value + values)
         then slope_found fuel' enough x high n points cs q paid
         else slope_found fuel' enough low x n points cs q paid
     end.

Definition slopes : nat := 12.

(** No corner with n drones at some points, and those of other classes at theirs, is too high. *)
Definition none_higher (enough : Z) (cs : list (nat * list (Z * Z))) (n : nat)
    (points : list (Z * Z)) (q paid : Z) : bool :=
  let (_, value) := best_at 0 points in
  let (_, values) := all_best_at 0 cs in
  let y := enough + paid in
  slope_found slopes enough y (y + (Z.of_nat n * value + values)) n points cs q paid.

(** Ways to place drones, (pixels, paid), without those after one that is no worse. *)
Fixpoint undominated (last : Z * Z) (ways : list (Z * Z)) : list (Z * Z) :=
  match ways with
  | [] => []
  | way :: rest =>
      if (fst way <=? fst last) && (snd last <=? snd way) then undominated last rest
      else way :: undominated way rest
  end.

Definition thinned (ways : list (Z * Z)) : list (Z * Z) :=
  match Sorting.sort ways with
  | [] => []
  | best :: rest => best :: undominated best rest
  end.

(** One more drone stands at one of some points, or at (0, 0); n more are left. *)
Definition one_more (enough : Z) (cs : list (nat * list (Z * Z))) (n : nat)
    (points ways : list (Z * Z)) : list (Z * Z) :=
  thinned (filter (fun way => negb (none_higher enough cs n points (fst way) (snd way)))
    (flat_map (fun way => way :: map (fun c => (fst way + fst c * fst c, snd way + snd c)) points)
              ways)).

Fixpoint with_class (enough : Z) (cs : list (nat * list (Z * Z))) (n : nat)
    (points ways : list (Z * Z)) : list (Z * Z) :=
  match n with
  | O => ways
  | S n' => with_class enough cs n' points (one_more enough cs n' points ways)
  end.

Fixpoint corners_ok (enough : Z) (cs : list (nat * list (Z * Z))) (ways : list (Z * Z)) : bool :=
  match cs with
  | [] => forallb (fun way => (0 <=? enough + snd way)
                              && (fst way <=? (enough + snd way) * (enough + snd way))) ways
  | (k, points) :: rest => corners_ok enough rest (with_class enough rest (size k) points ways)
  end.

Definition cut_ok (c : cut) : bool :=
  (0 <=? share c) && (0 <=? constant c)
  && forallb (fun kp => rising 0 (snd kp)) (curves c) && corners_ok (constant c) (curves c) [(0, 0)].

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

Lemma squares_nonneg l : 0 <= squares l.
Proof. unfold squares. apply sumZ_nonneg. intros x _. apply Z.square_nonneg. Qed.

Lemma best_at_ok x points : forall p, In p ((0, 0) :: points) ->
  fst p * fst p - 2 * x * snd p <= fst (best_at x points) /\ 0 <= fst (best_at x points).
Proof.
  induction points as [|[b v] points IH]; intros p Hp.
  - destruct Hp as [<- | []]. simpl. lia.
  - cbn [best_at]. pose proof (IH (0, 0) (or_introl eq_refl)) as [_ H0].
    destruct (best_at x points) as [most value] eqn:E. cbn [fst] in *.
    destruct (Z.ltb_spec most (b * b - 2 * x * v)); cbn [fst];
      (destruct Hp as [<- | [<- | Hp]]; [cbn [fst snd]; lia | cbn [fst snd]; lia |
        pose proof (IH p (or_intror Hp)); lia]).
Qed.

Lemma some_best_at x points : forall l n, (length l <= n)%nat ->
  (forall p, In p l -> In p ((0, 0) :: points)) ->
  squares l - 2 * x * values l <= Z.of_nat n * fst (best_at x points).
Proof.
  induction l as [|p l IH]; intros n Hn Hl.
  - unfold squares, values. cbn [map sumZ].
    pose proof (best_at_ok x points (0, 0) (or_introl eq_refl)) as [_ H].
    pose proof (Z.mul_nonneg_nonneg (Z.of_nat n) _ (Nat2Z.is_nonneg n) H). lia.
  - destruct n as [|n]; [simpl in Hn; lia|]. simpl in Hn.
    specialize (IH n ltac:(lia) (fun y Hy => Hl y (or_intror Hy))).
    pose proof (best_at_ok x points p (Hl p (or_introl eq_refl))) as [H _].
    unfold squares, values in *. cbn [map sumZ] in *. rewrite Nat2Z.inj_succ. lia.
Qed.

(** Drones with their classes, each at a point of its class, no more of a class than there are. *)
Definition at_corners (cs : list (nat * list (Z * Z))) (l : list (nat * (Z * Z))) : Prop :=
  (forall x, In x l -> In (snd x) ((0, 0) :: curve_in cs (fst x)))
  /\ (forall k, (length (filter (fun x => Nat.eqb k (fst x)) l) <= size k)%nat).

Definition of_class (k : nat) (l : list (nat * (Z * Z))) := filter (fun x => Nat.eqb k (fst x)) l.
Definition of_others (k : nat) (l : list (nat * (Z * Z))) :=
  filter (fun x => negb (Nat.eqb k (fst x))) l.

Lemma of_classes k points cs l : at_corners ((k, points) :: cs) l ->
  (length (map snd (of_class k l)) <= size k)%nat
  /\ (forall x, In x (map snd (of_class k l)) -> In x ((0, 0) :: points))
  /\ at_corners cs (of_others k l)
  /\ squares (map snd l) = squares (map snd (of_class k l)) + squares (map snd (of_others k l))
  /\ values (map snd l) = values (map snd (of_class k l)) + values (map snd (of_others k l)).
Proof.
  intros [Hl Hn]. unfold of_class, of_others. split; [|split; [|split; [split|split]]].
  - rewrite map_length. apply Hn.
  - intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
    apply filter_In in Hy. destruct Hy as [Hy E]. specialize (Hl y Hy).
    apply Nat.eqb_eq in E. cbn [curve_in] in Hl. rewrite <- E, Nat.eqb_refl in Hl. exact Hl.
  - intros x Hx. apply filter_In in Hx. destruct Hx as [Hx E]. specialize (Hl x Hx).
    cbn [curve_in] in Hl. destruct (Nat.eqb_spec (fst x) k) as [He | Hne]; [|exact Hl].
    exfalso. rewrite He, Nat.eqb_refl in E. discriminate.
  - intros k'. eapply Nat.le_trans; [|apply (Hn k')]. clear.
    induction l as [|x l IH]; simpl; [lia|].
    destruct (Nat.eqb k (fst x)), (Nat.eqb k' (fst x)) eqn:E; simpl; rewrite ?E; simpl; lia.
  - unfold squares. rewrite !map_map, (sumZ_filter (fun x => Nat.eqb k (fst x)) _ l). lia.
  - unfold values. rewrite !map_map, (sumZ_filter (fun x => Nat.eqb k (fst x)) _ l). lia.
Qed.

Lemma all_best_at_ok x cs : forall l, at_corners cs l ->
  squares (map snd l) - 2 * x * values (map snd l) <= fst (all_best_at x cs).
Proof.
  induction cs as [|[k points] cs IH]; intros l Hl.
  - destruct (zeros (map snd l)) as [-> ->]; [|simpl; lia].
    intros y Hy. apply in_map_iff in Hy. destruct Hy as [z [<- Hz]].
    destruct (proj1 Hl z Hz) as [E | []]. auto.
  - destruct (of_classes _ _ _ _ Hl) as [H1 [H2 [H3 [-> ->]]]]. specialize (IH _ H3).
    pose proof (some_best_at x points _ _ H1 H2) as H4. cbn [all_best_at].
    destruct (best_at x points) as [most value], (all_best_at x cs) as [mosts vs].
    cbn [fst] in *. lia.
Qed.

(** What a corner must obey, whose drones show q and are paid p. *)
Definition not_higher (enough q p : Z) : Prop := 0 <= enough + p /\ q <= (enough + p) * (enough + p).

Lemma slope_found_sound enough n points cs q p ls l : (length ls <= n)%nat ->
  (forall x, In x ls -> In x ((0, 0) :: points)) -> at_corners cs l ->
  forall fuel low high, slope_found fuel enough low high n points cs q p = true ->
  not_higher enough (q + squares ls + squares (map snd l)) (p + values ls + values (map snd l)).
Proof.
  intros Hn Hls Hl. induction fuel as [|fuel IH]; intros low high H; cbn [slope_found] in H;
    set (x := (low + high) / 2) in H;
    pose proof (some_best_at x points ls n Hn Hls) as H1;
    pose proof (all_best_at_ok x cs l Hl) as H2;
    destruct (best_at x points) as [most value], (all_best_at x cs) as [mosts vs];
    cbn [fst] in H1, H2; apply orb_true_iff in H; destruct H as [H | H].
  1, 3: split_andb; to_Z; unfold not_higher;
    set (y := enough + (p + values ls + values (map snd l)));
    pose proof (squares_nonneg (map snd l)); pose proof (squares_nonneg ls);
    pose proof (Z.square_nonneg (y - x));
    assert (Hy : q + squares ls + squares (map snd l) <= 2 * x * y - x * x) by (unfold y; lia);
    split; nia.
  - discriminate.
  - destruct (x <? _); eapply IH; exact H.
Qed.

Definition no_worse (y x : Z * Z) : Prop := fst x <= fst y /\ snd y <= snd x.

Lemma no_worse_stays enough y x q p : no_worse y x ->
  not_higher enough (fst y + q) (snd y + p) -> not_higher enough (fst x + q) (snd x + p).
Proof. intros [H1 H2] [H3 H4]. split; [lia|]. nia. Qed.

Lemma undominated_ok last ways : forall x, In x ways ->
  exists y, In y (last :: undominated last ways) /\ no_worse y x.
Proof.
  revert last. induction ways as [|way ways IH]; intros last x Hx; [destruct Hx|].
  cbn [undominated]. destruct ((fst way <=? fst last) && (snd last <=? snd way)) eqn:E.
  - destruct Hx as [<- | Hx]; [|exact (IH last x Hx)].
    split_andb. to_Z. exists last. split; [left; reflexivity | split; assumption].
  - destruct Hx as [<- | Hx].
    + exists way. split; [right; left; reflexivity | split; lia].
    + destruct (IH way x Hx) as [y [Hy Hb]]. exists y. split; [right; exact Hy | exact Hb].
Qed.

Lemma thinned_ok ways x : In x ways -> exists y, In y (thinned ways) /\ no_worse y x.
Proof.
  intros Hx. apply (Permutation_in _ (Sorting.Permuted_sort ways)) in Hx. unfold thinned.
  destruct (Sorting.sort ways) as [|best rest]; [destruct Hx|].
  destruct Hx as [<- | Hx]; [exists best; split; [left; reflexivity | split; lia]|].
  exact (undominated_ok best rest x Hx).
Qed.

(** Whatever n drones at some points, and those of other classes, add to a way. *)
Definition fine (enough : Z) (n : nat) (points : list (Z * Z)) (l : list (nat * (Z * Z)))
    (way : Z * Z) : Prop :=
  forall ls, (length ls <= n)%nat -> (forall x, In x ls -> In x ((0, 0) :: points)) ->
  not_higher enough (fst way + (squares ls + squares (map snd l)))
                    (snd way + (values ls + values (map snd l))).

Lemma one_more_sound enough cs n points ways l : at_corners cs l ->
  (forall y, In y (one_more enough cs n points ways) -> fine enough n points l y) ->
  forall x, In x ways -> fine enough (S n) points l x.
Proof.
  intros Hl Hy x Hx ls Hn Hls.
  assert (He : forall e, In e (flat_map (fun way => way ::
      map (fun c => (fst way + fst c * fst c, snd way + snd c)) points) ways) ->
    fine enough n points l e).
  { intros e He. destruct (none_higher enough cs n points (fst e) (snd e)) eqn:E.
    - intros ls' Hn' Hls'. rewrite !Z.add_assoc. unfold none_higher in E.
      destruct (best_at 0 points) as [m1 v1], (all_best_at 0 cs) as [m2 v2].
      exact (slope_found_sound _ _ _ _ _ _ _ _ Hn' Hls' Hl _ _ _ E).
    - destruct (thinned_ok (filter (fun way => negb (none_higher enough cs n points (fst way) (snd way)))
        (flat_map (fun way => way :: map (fun c => (fst way + fst c * fst c, snd way + snd c)) points) ways)) e)
        as [y [H1 H2]]; [apply filter_In; split; [exact He | rewrite E; reflexivity]|].
      intros ls' Hn' Hls'. exact (no_worse_stays _ _ _ _ _ H2 (Hy y H1 ls' Hn' Hls')). }
  destruct ls as [|c ls].
  - apply (He x); [|simpl; lia | intros y []].
    apply in_flat_map. exists x. split; [exact Hx | left; reflexivity].
  - simpl in Hn. pose proof (Hls c (or_introl eq_refl)) as Hc.
    assert (Hls' : forall y, In y ls -> In y ((0, 0) :: points)) by (intros y Hin; apply Hls; right; exact Hin).
    unfold squares, values in *. cbn [map sumZ].
    assert (Hin : In (fst x + fst c * fst c, snd x + snd c) (flat_map (fun way => way ::
      map (fun c => (fst way + fst c * fst c, snd way + snd c)) points) ways)).
    { apply in_flat_map. exists x. split; [exact Hx|]. destruct Hc as [<- | Hc].
      - left. destruct x as [q p]. cbn [fst snd]. f_equal; lia.
      - right. apply in_map_iff. exists c. split; [reflexivity | exact Hc]. }
    pose proof (He _ Hin ls ltac:(lia) Hls') as H. unfold squares, values in H. cbn [fst snd] in H.
    rewrite <- !Z.add_assoc in *. exact H.
Qed.

Lemma with_class_sound enough cs points l : at_corners cs l -> forall n ways,
  (forall y, In y (with_class enough cs n points ways) -> fine enough 0 points l y) ->
  forall x, In x ways -> fine enough n points l x.
Proof.
  intros Hl. induction n as [|n IH]; intros ways Hy x Hx; cbn [with_class] in Hy.
  - exact (Hy x Hx).
  - apply (one_more_sound _ cs _ _ ways _ Hl); [|exact Hx]. exact (IH _ Hy).
Qed.

Lemma corners_sound enough cs : forall ways l, corners_ok enough cs ways = true ->
  at_corners cs l -> forall x, In x ways ->
  not_higher enough (fst x + squares (map snd l)) (snd x + values (map snd l)).
Proof.
  induction cs as [|[k points] cs IH]; intros ways l H Hl x Hx; cbn [corners_ok] in H.
  - rewrite forallb_forall in H. specialize (H x Hx). split_andb. to_Z.
    destruct (zeros (map snd l)) as [-> ->].
    + intros y Hy. apply in_map_iff in Hy. destruct Hy as [z [<- Hz]].
      destruct (proj1 Hl z Hz) as [E | []]. auto.
    + rewrite !Z.add_0_r. split; assumption.
  - destruct (of_classes _ _ _ _ Hl) as [H1 [H2 [H3 [-> ->]]]].
    apply (with_class_sound enough cs points (of_others k l) H3 (size k) ways); try assumption.
    intros y Hy ls Hn _. destruct ls; [|simpl in Hn; lia].
    unfold squares at 1, values at 1. cbn [map sumZ]. rewrite !Z.add_0_l.
    exact (IH _ _ H H3 y Hy).
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
  assert (C3 : corners_ok (constant c) (curves c) [(0, 0)] = true) by assumption.
  destruct (corners_sound _ _ _ l C3 (conj C1 C2) (0, 0) (or_introl eq_refl)) as [C4 C5].
  cbn [fst snd] in C4, C5. rewrite Esnd, !Z.add_0_l in C4, C5.
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
