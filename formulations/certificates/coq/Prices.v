(** What drones are paid for what they see, and the constants that go with it: whole numbers. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation Mergesort Orders.
From CocapCheck Require Import Spec Sums Returns.
Import ListNotations.
Open Scope Z_scope.

(** Functions of what each drone has.  Curves are given by points (root, value) for each class.  Where
    states have values, a drone has that of its class and state if it is listed.  They are listed in sets
    in each of which one drone can be at most.  In other states it has its root, or what its pixels have by
    the line that touches the root at a knee, whichever is less. *)
Inductive functions := Curves (l : list (nat * list (Z * Z))) | States (knee : Z) (l : list (list (nat * state * Z))).

(** A share of a root is bounded by a constant and functions of what each drone has: all in 1/scale. *)
Record cut := Cut { share : Z; constant : Z; phis : functions }.

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

(** The value of a class and state in a set, and in the first set that has one. *)
Fixpoint value_in (k : nat) (s : state) (set : list (nat * state * Z)) : option Z :=
  match set with
  | [] => None
  | (k', s', v) :: rest => if Pos.eqb s s' && Nat.eqb k k' then Some v else value_in k s rest
  end.

Fixpoint value_of (k : nat) (s : state) (sets : list (list (nat * state * Z))) : option Z :=
  match sets with
  | [] => None
  | set :: rest => match value_in k s set with Some v => Some v | None => value_of k s rest end
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

(** An amount in 1/scale^2, rounded up. *)
Definition pixels_of (c : Z) : Z := cdiv (c * (scale M * scale M)) (amount_unit I).

(** What an amount has in a state that is not listed. *)
Definition unlisted (knee c root : Z) : Z := Z.min root (cdiv (pixels_of c) (2 * knee)).

(** The function of a cut at a state from which an amount is seen, and its root. *)
Definition cut_phi (k : nat) (s : state) (c root : Z) (x : cut) : Z :=
  match phis x with
  | Curves l => phi 0 0 (curve_in l k) root
  | States knee l => if c =? 0 then 0 else match value_of k s l with Some v => v | None => unlisted knee c root end
  end.

Definition cut_pay (k : nat) (s : state) (c root : Z) (x : cut) : Z := share x * cut_phi k s c root x.

(** The payment for a view from a state, in 1/pay_unit. *)
Definition pay (k : nat) (s : state) (v : group * Z) : Z :=
  let (g, c) := v in
  let p := prices M g in
  let root := root_of c in
  weight I g * (amount_unit I * (alpha p * root + sumZ (map (cut_pay k s c root) (cuts p)))
                + scale M * (beta p * c)).

Definition pay_unit : Z := scale M * scale M * amount_unit I * weight_unit I.

(** The payment for all views of a state, rounded up to 1/precision. *)
Definition paid (k t : nat) (s : state) : Z :=
  cdiv (precision M * sumZ (map (pay k s) (sees I k t s))) pay_unit.

Definition view_ok (k t : nat) (s : state) (v : group * Z) : bool :=
  (0 <=? snd v) && (0 <=? pay k s v) && (over_time M || Nat.eqb (at_step (prices M (fst v))) t).

Fixpoint increasing (vs : list (group * Z)) : bool :=
  match vs with
  | v :: ((w :: _) as rest) => Pos.ltb (fst v) (fst w) && increasing rest
  | _ => true
  end.

Definition views_ok (k t : nat) (s : state) : bool :=
  increasing (sees I k t s) && forallb (view_ok k t s) (sees I k t s).

(** * Cuts: the constant is enough at all corners *)

Definition size (k : nat) : nat := length (filter (fun d => Nat.eqb k (fst d)) (team I)).

(** At a slope, a point (pixels, value) is worth q - 2 x v: of some points the most, or 0, and the value
    there. *)
Fixpoint best_at (x2 : Z) (points : list (Z * Z)) : Z * Z :=
  match points with
  | [] => (0, 0)
  | (q, v) :: rest =>
      let (most, value) := best_at x2 rest in
      let here := q - x2 * v in
      if most <? here then (here, v) else (most, value)
  end.

(** The same of some crowds together: each so many drones at most, and the points at one of which each is. *)
Fixpoint all_best_at (x2 : Z) (crowds : list (nat * list (Z * Z))) : Z * Z :=
  match crowds with
  | [] => (0, 0)
  | (n, points) :: rest =>
      let (most, value) := best_at x2 points in
      let (mosts, values) := all_best_at x2 rest in
      (Z.of_nat n * most + mosts, Z.of_nat n * value + values)
  end.

(** All that follows has q' <= y'^2 for y' = enough + paid', as 2 x y' - x^2 <= y'^2 for each x.
    An x that shows it is looked for by bisection.  Left of a knee the line that touches the root there
    takes the root's place; so the x must not be less. *)
Fixpoint slope_found (fuel : nat) (knee enough low high : Z) (crowds : list (nat * list (Z * Z)))
    (q paid : Z) : bool :=
  let x := (low + high) / 2 in
  let (mosts, values) := all_best_at (2 * x) crowds in
  ((0 <? x) && (knee <=? x) && (0 <=? q) && (q + mosts <=? 2 * x * (enough + paid) - x * x))
  || match fuel with
     | O => false
     | S fuel' =>
         if x <? enough + paid + values
         then slope_found fuel' knee enough x high crowds q paid
         else slope_found fuel' knee enough low x crowds q paid
     end.

Definition slopes : nat := 12.

(** No corner with these crowds at their points is too high: by the line at the knee, or by another. *)
Definition none_higher (knee enough : Z) (crowds : list (nat * list (Z * Z))) (q paid : Z) : bool :=
  ((0 <? knee) && slope_found 0 knee enough knee knee crowds q paid)
  || let (_, values) := all_best_at 0 crowds in
     let y := enough + paid in
     slope_found slopes knee enough (Z.max knee y) (Z.max knee (y + values)) crowds q paid.

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

(** One more drone stands at one of some points, or at (0, 0); these crowds are left. *)
Definition one_more (knee enough : Z) (left : list (nat * list (Z * Z))) (points ways : list (Z * Z)) : list (Z * Z) :=
  thinned (filter (fun way => negb (none_higher knee enough left (fst way) (snd way)))
    (flat_map (fun way => way :: map (fun c => (fst way + fst c, snd way + snd c)) points) ways)).

Fixpoint with_crowd (knee enough : Z) (rest : list (nat * list (Z * Z))) (n : nat)
    (points ways : list (Z * Z)) : list (Z * Z) :=
  match n with
  | O => ways
  | S n' => with_crowd knee enough rest n' points
              (one_more knee enough (match n' with O => rest | _ => (n', points) :: rest end) points ways)
  end.

(** The root of a corner, or the line left of the knee, is none too high. *)
Definition corner_ok (knee enough : Z) (way : Z * Z) : bool :=
  let (q, paid) := way in
  let y := enough + paid in
  (0 <=? y) && (q <=? y * y) && ((knee * knee <=? q) || (q + knee * knee <=? 2 * knee * y)).

Fixpoint corners_ok (knee enough : Z) (crowds : list (nat * list (Z * Z))) (ways : list (Z * Z)) : bool :=
  match crowds with
  | [] => forallb (corner_ok knee enough) ways
  | (n, points) :: rest => corners_ok knee enough rest (with_crowd knee enough rest n points ways)
  end.

(** The drones of a class, at the points of its curve. *)
Definition crowd_of (kp : nat * list (Z * Z)) : nat * list (Z * Z) :=
  (size (fst kp), map (fun p => (fst p * fst p, snd p)) (snd kp)).

(** The points of states that see a group. *)
Definition points_of (g : group) (set : list (nat * state * Z)) : list (Z * Z) :=
  let t := at_step (prices M g) in
  map (fun x => let '(k, s, v) := x in (pixels_of (amount I g k t s), v)) set.

(** Two drones cannot be in states of a set, not even in the same. *)
Definition one_at_most (set : list (nat * state * Z)) : bool :=
  let places := map (fun x => let '(k, s, _) := x in (k, place I k s)) set in
  forallb (fun a => forallb (meet I a) places) places.

Definition phis_ok (g : group) (enough : Z) (f : functions) : bool :=
  match f with
  | Curves l => forallb (fun kp => rising 0 (snd kp)) l && corners_ok 0 enough (map crowd_of l) [(0, 0)]
  | States knee l =>
      (0 <? knee) && forallb one_at_most l
      && corners_ok knee enough (map (fun set => (1%nat, points_of g set)) l) [(0, 0)]
  end.

Definition cut_ok (g : group) (c : cut) : bool :=
  (0 <=? share c) && (0 <=? constant c) && phis_ok g (constant c) (phis c).

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
      && forallb (cut_ok g) cs
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

Lemma root_of_square c : 0 <= c ->
  0 <= root_of c /\ c * (scale M * scale M) <= root_of c * root_of c * amount_unit I.
Proof.
  intros Hc. destruct units as [Zs [Zu [Za Zw]]]. unfold root_of. destruct (c =? 0) eqn:E0.
  - to_Z. subst. split; lia.
  - cbv zeta. match goal with |- context [if ?b then _ else _] => destruct b eqn:E end.
    + split_andb. to_Z. split; assumption.
    + split; [nia|]. replace (scale M * (c + 1) * (scale M * (c + 1)) * amount_unit I)
        with ((scale M * scale M) * ((c + 1) * (c + 1) * amount_unit I)) by ring.
      rewrite Z.mul_comm. apply Z.mul_le_mono_nonneg_l; nia.
Qed.

(** A root of an amount is no more than a number whose square is none too low. *)
Lemma root_below x r : 0 <= r -> (0 <= x)%R -> (x * (IZR (scale M) * IZR (scale M)) <= IZR (r * r))%R ->
  (sqrt x * IZR (scale M) <= IZR r)%R.
Proof.
  intros Hr Hx H. real_units. rewrite mult_IZR in H.
  apply Rsqr_incr_0_var; [|apply IZR_nonneg; exact Hr]. unfold Rsqr.
  replace (sqrt x * IZR (scale M) * (sqrt x * IZR (scale M)))%R
    with (sqrt x * sqrt x * (IZR (scale M) * IZR (scale M)))%R by ring.
  rewrite sqrt_sqrt by exact Hx. exact H.
Qed.

Lemma root_of_ok c : 0 <= c ->
  (0 <= sqrt (IZR c / IZR (amount_unit I)) * IZR (scale M) <= IZR (root_of c))%R.
Proof.
  intros Hc. real_units. pose proof (sqrt_pos (IZR c / IZR (amount_unit I))) as Hp.
  split; [apply Rmult_le_pos; lra|]. destruct (root_of_square c Hc) as [Hr H].
  apply root_below; [exact Hr | exact (frac_nonneg c _ Hc Za)|].
  apply IZR_le in H. rewrite !mult_IZR in H. rewrite mult_IZR.
  apply Rmult_le_reg_r with (IZR (amount_unit I)); [lra|].
  replace (IZR c / IZR (amount_unit I) * (IZR (scale M) * IZR (scale M)) * IZR (amount_unit I))%R
    with (IZR c * (IZR (scale M) * IZR (scale M)))%R by (field; lra).
  exact H.
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

Definition pixels (l : list (Z * Z)) : Z := sumZ (map fst l).

(** In each crowd some drones are at points of it; all of them together are a corner. *)
Definition in_crowd (crowd : nat * list (Z * Z)) (l : list (Z * Z)) : Prop :=
  (length l <= fst crowd)%nat /\ (forall x, In x l -> In x ((0, 0) :: snd crowd) /\ 0 <= fst x).
Definition placed (crowds : list (nat * list (Z * Z))) (ls : list (list (Z * Z))) : Prop :=
  Forall2 in_crowd crowds ls.

Lemma pixels_app a b : pixels (a ++ b) = pixels a + pixels b.
Proof. unfold pixels. rewrite map_app. apply sumZ_app. Qed.

Lemma values_app a b : values (a ++ b) = values a + values b.
Proof. unfold values. rewrite map_app. apply sumZ_app. Qed.

Lemma pixels_nonneg crowds ls : placed crowds ls -> 0 <= pixels (concat ls).
Proof.
  induction 1 as [|crowd l crowds ls [_ Hl] H IH]; [unfold pixels; simpl; lia|]. simpl. rewrite pixels_app.
  enough (0 <= pixels l) by lia. apply sumZ_nonneg. intros x Hx. apply Hl, Hx.
Qed.

Lemma best_at_ok x points : forall p, In p ((0, 0) :: points) ->
  fst p - x * snd p <= fst (best_at x points) /\ 0 <= fst (best_at x points).
Proof.
  induction points as [|[q v] points IH]; intros p Hp.
  - destruct Hp as [<- | []]. simpl. lia.
  - cbn [best_at]. pose proof (IH (0, 0) (or_introl eq_refl)) as [_ H0].
    destruct (best_at x points) as [most value] eqn:E. cbn [fst] in *.
    destruct (Z.ltb_spec most (q - x * v)); cbn [fst];
      (destruct Hp as [<- | [<- | Hp]]; [cbn [fst snd]; lia | cbn [fst snd]; lia |
        pose proof (IH p (or_intror Hp)); lia]).
Qed.

Lemma some_best_at x points : forall l n, (length l <= n)%nat ->
  (forall p, In p l -> In p ((0, 0) :: points)) ->
  pixels l - x * values l <= Z.of_nat n * fst (best_at x points).
Proof.
  induction l as [|p l IH]; intros n Hn Hl.
  - unfold pixels, values. cbn [map sumZ].
    pose proof (best_at_ok x points (0, 0) (or_introl eq_refl)) as [_ H].
    pose proof (Z.mul_nonneg_nonneg (Z.of_nat n) _ (Nat2Z.is_nonneg n) H). lia.
  - destruct n as [|n]; [simpl in Hn; lia|]. simpl in Hn.
    specialize (IH n ltac:(lia) (fun y Hy => Hl y (or_intror Hy))).
    pose proof (best_at_ok x points p (Hl p (or_introl eq_refl))) as [H _].
    unfold pixels, values in *. cbn [map sumZ] in *. rewrite Nat2Z.inj_succ. lia.
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

(** So are the crowds of classes, for drones at points of theirs. *)
Lemma placed_classes cs : forall l, at_corners cs l ->
  exists ls, placed (map crowd_of cs) ls /\ pixels (concat ls) = squares (map snd l)
             /\ values (concat ls) = values (map snd l).
Proof.
  induction cs as [|[k points] cs IH]; intros l Hl.
  - exists []. split; [constructor|]. destruct (zeros (map snd l)) as [-> ->]; [|split; reflexivity].
    intros y Hy. apply in_map_iff in Hy. destruct Hy as [z [<- Hz]].
    destruct (proj1 Hl z Hz) as [E | []]. auto.
  - destruct (of_classes _ _ _ _ Hl) as [H1 [H2 [H3 [-> ->]]]]. destruct (IH _ H3) as [ls [H4 [<- <-]]].
    set (here := map snd (of_class k l)) in *. exists (map (fun p => (fst p * fst p, snd p)) here :: ls).
    split; [constructor; [|exact H4]|].
    + split; [rewrite map_length; exact H1|]. intros x Hx. apply in_map_iff in Hx. destruct Hx as [p [<- Hp]].
      split; [|apply Z.square_nonneg].
      destruct (H2 p Hp) as [<- | Hin]; [left; reflexivity | right].
      apply in_map_iff. exists p. split; [reflexivity | exact Hin].
    + simpl. rewrite pixels_app, values_app. unfold pixels at 1, values at 1, squares, values.
      rewrite !map_map. split; reflexivity.
Qed.

Lemma all_best_at_ok x crowds ls : placed crowds ls ->
  pixels (concat ls) - x * values (concat ls) <= fst (all_best_at x crowds).
Proof.
  induction 1 as [|[n points] l crowds ls [Hn Hl] H IH]; [unfold pixels, values; simpl; lia|].
  simpl concat. rewrite pixels_app, values_app. cbn [all_best_at].
  pose proof (some_best_at x points l n Hn (fun p Hp => proj1 (Hl p Hp))) as H1.
  destruct (best_at x points) as [most value], (all_best_at x crowds) as [mosts vs].
  cbn [fst] in *. lia.
Qed.

(** What a corner must obey, whose drones show q and are paid p: its root is at most y = enough + p, as is
    the line that touches the root at the knee, where q is left of it. *)
Definition not_higher (knee enough q p : Z) : Prop :=
  0 <= enough + p /\ q <= (enough + p) * (enough + p)
  /\ (knee * knee <= q \/ q + knee * knee <= 2 * knee * (enough + p)).

Lemma corner_ok_sound knee enough way : corner_ok knee enough way = true ->
  not_higher knee enough (fst way) (snd way).
Proof.
  destruct way as [q p]. unfold corner_ok, not_higher. cbn [fst snd]. cbv zeta. intros H.
  apply andb_true_iff in H. destruct H as [H H1]. apply andb_true_iff in H. destruct H as [H2 H3].
  apply orb_true_iff in H1. rewrite !Z.leb_le in *. auto.
Qed.

(** Lines that touch the root at the knee or beyond are nowhere below the root, nor the line of the knee. *)
Lemma below_tangent knee x q y : 0 <= knee -> knee <= x -> 0 < x -> 0 <= q -> q <= 2 * x * y - x * x ->
  0 <= y /\ q <= y * y /\ (knee * knee <= q \/ q + knee * knee <= 2 * knee * y).
Proof.
  intros Hk Hx H0 Hq H. pose proof (Z.square_nonneg (y - x)) as Hs.
  split; [nia|]. split; [nia|]. destruct (Z.le_gt_cases (knee * knee) q) as [Hl | Hl]; [left; exact Hl | right].
  apply Z.mul_le_mono_pos_l with x; [exact H0|].
  assert (H1 : 0 <= (x - knee) * (knee * x - q)) by (apply Z.mul_nonneg_nonneg; nia).
  assert (H2 : knee * (q + x * x) <= knee * (2 * x * y)) by (apply Z.mul_le_mono_nonneg_l; lia).
  nia.
Qed.

Lemma slope_found_sound knee enough crowds q p ls : 0 <= knee -> placed crowds ls ->
  forall fuel low high, slope_found fuel knee enough low high crowds q p = true ->
  not_higher knee enough (q + pixels (concat ls)) (p + values (concat ls)).
Proof.
  intros Hk Hls. induction fuel as [|fuel IH]; intros low high H; cbn [slope_found] in H;
    set (x := (low + high) / 2) in H;
    pose proof (all_best_at_ok (2 * x) crowds ls Hls) as H1;
    destruct (all_best_at (2 * x) crowds) as [mosts vs];
    cbn [fst] in H1; apply orb_true_iff in H; destruct H as [H | H].
  1, 3: split_andb; to_Z; pose proof (pixels_nonneg _ _ Hls);
    apply below_tangent with x; [exact Hk | assumption | assumption | lia | lia].
  - discriminate.
  - destruct (x <? _); eapply IH; exact H.
Qed.

Definition no_worse (y x : Z * Z) : Prop := fst x <= fst y /\ snd y <= snd x.

Lemma no_worse_stays knee enough y x q p : 0 <= knee -> no_worse y x ->
  not_higher knee enough (fst y + q) (snd y + p) -> not_higher knee enough (fst x + q) (snd x + p).
Proof.
  intros Hk [H1 H2] [H3 [H4 H5]]. unfold not_higher.
  set (a := enough + (snd y + p)) in *. set (b := enough + (snd x + p)) in *.
  assert (Hab : a <= b) by (unfold a, b; lia). split; [lia|]. split; [nia|].
  destruct (Z.le_gt_cases (knee * knee) (fst x + q)) as [Hl | Hl]; [left; exact Hl | right].
  destruct H5 as [H5 | H5]; [assert (knee <= a) by nia|]; nia.
Qed.

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

(** Whatever these crowds add to a way. *)
Definition fine (knee enough : Z) (crowds : list (nat * list (Z * Z))) (way : Z * Z) : Prop :=
  forall ls, placed crowds ls -> not_higher knee enough (fst way + pixels (concat ls)) (snd way + values (concat ls)).

Lemma one_more_sound knee enough left points ways x c : 0 <= knee ->
  (forall y, In y (one_more knee enough left points ways) -> fine knee enough left y) ->
  In x ways -> In c ((0, 0) :: points) -> fine knee enough left (fst x + fst c, snd x + snd c).
Proof.
  intros Hk Hy Hx Hc.
  set (e := (fst x + fst c, snd x + snd c)).
  assert (He : In e (flat_map (fun way => way :: map (fun c => (fst way + fst c, snd way + snd c)) points) ways)).
  { apply in_flat_map. exists x. split; [exact Hx|]. destruct Hc as [<- | Hc].
    - left. unfold e. destruct x as [q p]. cbn [fst snd]. f_equal; lia.
    - right. apply in_map_iff. exists c. split; [reflexivity | exact Hc]. }
  destruct (none_higher knee enough left (fst e) (snd e)) eqn:E.
  - intros ls Hls. unfold none_higher in E. apply orb_true_iff in E. destruct E as [E | E].
    + apply andb_true_iff in E. exact (slope_found_sound _ _ _ _ _ _ Hk Hls _ _ _ (proj2 E)).
    + destruct (all_best_at 0 left) as [m v]. exact (slope_found_sound _ _ _ _ _ _ Hk Hls _ _ _ E).
  - destruct (thinned_ok (filter (fun way => negb (none_higher knee enough left (fst way) (snd way)))
      (flat_map (fun way => way :: map (fun c => (fst way + fst c, snd way + snd c)) points) ways)) e)
      as [y [H1 H2]]; [apply filter_In; split; [exact He | rewrite E; reflexivity]|].
    intros ls Hls. exact (no_worse_stays _ _ _ _ _ _ Hk H2 (Hy y H1 ls Hls)).
Qed.

Lemma with_crowd_sound knee enough rest points : 0 <= knee -> forall n ways,
  (forall y, In y (with_crowd knee enough rest n points ways) -> fine knee enough rest y) ->
  forall x, In x ways -> fine knee enough ((n, points) :: rest) x.
Proof.
  intros Hk. induction n as [|n IH]; intros ways Hy x Hx ls Hls; inversion Hls as [|crowd l cs ls' [Hn Hl] Hls']; subst;
    cbn [fst] in Hn; simpl concat; rewrite pixels_app, values_app; cbn [with_crowd] in Hy.
  - destruct l; [|simpl in Hn; lia]. exact (Hy x Hx ls' Hls').
  - specialize (IH _ Hy).
    set (left := match n with O => rest | _ => (n, points) :: rest end) in *.
    assert (Hleft : forall y, In y (one_more knee enough left points ways) -> fine knee enough left y).
    { intros y H. specialize (IH y H). unfold left. destruct n as [|n]; [|exact IH].
      intros ls'' H''. apply (IH ([] :: ls'')). constructor; [|exact H''].
      split; [simpl; lia | intros z []]. }
    assert (Hplaced : forall l', (length l' <= n)%nat -> (forall z, In z l' -> In z ((0, 0) :: points) /\ 0 <= fst z) ->
      forall way, fine knee enough left way ->
      not_higher knee enough (fst way + (pixels l' + pixels (concat ls'))) (snd way + (values l' + values (concat ls')))).
    { intros l' H1 H2 way Hw. unfold left in Hw. destruct n as [|n].
      - destruct l'; [|simpl in H1; lia]. exact (Hw ls' Hls').
      - rewrite <- pixels_app, <- values_app. apply (Hw (l' :: ls')). constructor; [split; assumption | exact Hls']. }
    destruct l as [|c l].
    + pose proof (one_more_sound knee enough left points ways x (0, 0) Hk Hleft Hx (or_introl eq_refl)) as H.
      specialize (Hplaced [] ltac:(simpl; lia) ltac:(intros z []) _ H). cbn [fst snd] in Hplaced.
      rewrite !Z.add_0_r in Hplaced. exact Hplaced.
    + simpl in Hn. destruct (Hl c (or_introl eq_refl)) as [Hc _].
      pose proof (one_more_sound knee enough left points ways x c Hk Hleft Hx Hc) as H.
      specialize (Hplaced l ltac:(lia) (fun z Hz => Hl z (or_intror Hz)) _ H). cbn [fst snd] in Hplaced.
      unfold pixels at 1, values at 1. cbn [map sumZ]. fold (pixels l) (values l).
      rewrite <- !Z.add_assoc in *. exact Hplaced.
Qed.

Lemma corners_sound knee enough crowds : 0 <= knee -> forall ways, corners_ok knee enough crowds ways = true ->
  forall x, In x ways -> fine knee enough crowds x.
Proof.
  intros Hk. induction crowds as [|[n points] crowds IH]; intros ways H x Hx; cbn [corners_ok] in H.
  - intros ls Hls. inversion Hls. subst. rewrite forallb_forall in H. specialize (H x Hx).
    unfold pixels, values. simpl. rewrite !Z.add_0_r. exact (corner_ok_sound _ _ _ H).
  - apply (with_crowd_sound knee enough crowds points Hk n ways); [|exact Hx]. intros y Hy. exact (IH _ H y Hy).
Qed.

(** What a group is seen of by some drones: class, state and amount. *)
Definition views := list (nat * state * Z).
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

Definition class_at (x : nat * state * Z) : nat := fst (fst x).
Definition state_at (x : nat * state * Z) : state := snd (fst x).
Definition separate (x y : nat * state * Z) : Prop :=
  meet I (class_at x, place I (class_at x) (state_at x)) (class_at y, place I (class_at y) (state_at y)) = false.

(** All drones at the step of a group, where it is seen. *)
Definition of_team (g : group) (vs : views) : Prop :=
  map class_at vs = map fst (team I) /\ ForallOrdPairs separate vs
  /\ forall x, In x vs -> snd x = amount I g (class_at x) (at_step (prices M g)) (state_at x).

(** * Values of states *)

Lemma value_in_set k s set v : value_in k s set = Some v -> In (k, s, v) set.
Proof.
  induction set as [|[[k' s'] v'] set IH]; simpl; [discriminate|].
  destruct (Pos.eqb_spec s s') as [-> |]; destruct (Nat.eqb_spec k k') as [-> |]; simpl; auto.
  intros E. injection E as ->. left. reflexivity.
Qed.

Definition has_value (set : list (nat * state * Z)) (x : nat * state * Z) : bool :=
  match value_in (class_at x) (state_at x) set with Some _ => true | None => false end.

Lemma one_has_value set vs : one_at_most set = true -> ForallOrdPairs separate vs ->
  (length (filter (has_value set) vs) <= 1)%nat.
Proof.
  intros Hset Hvs. apply (filter_pairs _ (has_value set)) in Hvs.
  assert (Hin : forall x, In x (filter (has_value set) vs) ->
    In (class_at x, place I (class_at x) (state_at x)) (map (fun x => let '(k, s, _) := x in (k, place I k s)) set)).
  { intros x Hx. apply filter_In in Hx. destruct Hx as [_ Hx]. unfold has_value in Hx.
    destruct (value_in (class_at x) (state_at x) set) as [v|] eqn:E; [|discriminate].
    apply value_in_set in E. apply in_map_iff. exists (class_at x, state_at x, v). split; [reflexivity | exact E]. }
  destruct (filter (has_value set) vs) as [|a [|b l]]; simpl; [lia | lia|]. exfalso.
  inversion Hvs as [|a' l' Ha]; subst. apply Forall_cons_iff in Ha. destruct Ha as [Ha _].
  unfold one_at_most in Hset. rewrite forallb_forall in Hset.
  specialize (Hset _ (Hin a (or_introl eq_refl))). rewrite forallb_forall in Hset.
  specialize (Hset _ (Hin b (or_intror (or_introl eq_refl)))). unfold separate in Ha. congruence.
Qed.

Definition else_of (knee : Z) (x : nat * state * Z) : Z := unlisted knee (snd x) (root_of (snd x)).
Definition phi_of (knee : Z) (sets : list (list (nat * state * Z))) (x : nat * state * Z) : Z :=
  match value_of (class_at x) (state_at x) sets with Some v => v | None => else_of knee x end.

(** Drones that stand at listed states are in the sets, one in each; the others have what such drones have. *)
Lemma stand_apart knee g sets : forall vs, forallb one_at_most sets = true -> ForallOrdPairs separate vs ->
  all_nonneg vs -> (forall x, In x vs -> snd x = amount I g (class_at x) (at_step (prices M g)) (state_at x)) ->
  exists ls (rest : views), placed (map (fun set => (1%nat, points_of g set)) sets) ls /\ all_nonneg rest
    /\ sumZ (map (fun x => pixels_of (snd x)) vs) = pixels (concat ls) + sumZ (map (fun x => pixels_of (snd x)) rest)
    /\ sumZ (map (phi_of knee sets) vs) = values (concat ls) + sumZ (map (else_of knee) rest).
Proof.
  induction sets as [|set sets IH]; intros vs Hsets Hvs Hn Ha.
  - exists [], vs. split; [constructor|]. split; [exact Hn|]. unfold pixels, values. simpl. split; reflexivity.
  - simpl in Hsets. apply andb_true_iff in Hsets. destruct Hsets as [Hset Hsets].
    set (others := filter (fun x => negb (has_value set x)) vs).
    assert (Hsub : forall x, In x others -> In x vs) by (intros x Hx; apply filter_In in Hx; apply Hx).
    destruct (IH others Hsets (filter_pairs _ _ _ Hvs) (fun x Hx => Hn x (Hsub x Hx)) (fun x Hx => Ha x (Hsub x Hx)))
      as [ls [rest [H1 [H2 [H3 H4]]]]].
    set (here := filter (has_value set) vs).
    set (point := fun x : nat * state * Z => (pixels_of (snd x),
           match value_in (class_at x) (state_at x) set with Some v => v | None => 0 end)).
    exists (map point here :: ls), rest. split; [|split; [exact H2|]].
    + simpl. constructor; [|exact H1]. split; [rewrite map_length; apply one_has_value; assumption|].
      intros c Hc. apply in_map_iff in Hc. destruct Hc as [x [<- Hx]]. apply filter_In in Hx. destruct Hx as [Hx Hv].
      unfold has_value in Hv. unfold point. cbn [fst snd].
      destruct (value_in (class_at x) (state_at x) set) as [v|] eqn:E; [|discriminate]. split.
      * right. apply value_in_set in E. unfold points_of. apply in_map_iff.
        exists (class_at x, state_at x, v). split; [|exact E]. rewrite (Ha x Hx). reflexivity.
      * specialize (Hn x Hx). destruct units as [Zs [_ [Za _]]].
        pose proof (cdiv_ge (snd x * (scale M * scale M)) (amount_unit I) Za) as Hd. fold (pixels_of (snd x)) in Hd. nia.
    + simpl concat. rewrite pixels_app, values_app. unfold pixels at 1, values at 1. rewrite !map_map.
      rewrite (sumZ_filter (has_value set) (fun x => pixels_of (snd x)) vs), (sumZ_filter (has_value set) (phi_of knee (set :: sets)) vs).
      fold here others. rewrite H3.
      replace (sumZ (map (phi_of knee (set :: sets)) others)) with (sumZ (map (phi_of knee sets) others)).
      2:{ apply sumZ_ext. intros x Hx. apply filter_In in Hx. destruct Hx as [_ Hx]. unfold has_value in Hx.
          unfold phi_of. cbn [value_of]. destruct (value_in (class_at x) (state_at x) set); [discriminate | reflexivity]. }
      replace (sumZ (map (phi_of knee (set :: sets)) here)) with (sumZ (map (fun x => snd (point x)) here)).
      2:{ apply sumZ_ext. intros x Hx. apply filter_In in Hx. destruct Hx as [_ Hx]. unfold has_value in Hx.
          unfold phi_of, point. cbn [value_of snd]. destruct (value_in (class_at x) (state_at x) set); [reflexivity | discriminate]. }
      rewrite H4. cbn [point fst]. split; lia.
Qed.

(** A drone more, at a root or at the price of the line, changes nothing. *)
Lemma one_stays knee enough q p d v : 0 < knee -> 0 <= q -> 0 <= d -> 0 <= v ->
  d <= v * v \/ d <= 2 * knee * v -> not_higher knee enough q p -> not_higher knee enough (q + d) (p + v).
Proof.
  intros Hk Hq Hd Hv Hdv [H1 [H2 H3]]. unfold not_higher. rewrite Z.add_assoc.
  set (y := enough + p) in *. split; [lia|]. destruct Hdv as [Hr | Hl].
  - split; [nia|]. destruct H3 as [H3 | H3]; [left; lia|].
    destruct (Z.le_gt_cases (knee * knee) (q + d)) as [Hc | Hc]; [left; exact Hc | right].
    enough (d <= 2 * knee * v) by lia. destruct (Z.le_gt_cases knee v); nia.
  - destruct H3 as [H3 | H3].
    + assert (Hy : knee <= y) by nia. split; [nia | left; lia].
    + assert (H4 : q + d + knee * knee <= 2 * knee * (y + v)) by lia.
      pose proof (Z.square_nonneg (y + v - knee)). split; [nia | right; exact H4].
Qed.

Lemma pixels_of_nonneg c : 0 <= c -> 0 <= pixels_of c.
Proof.
  intros Hc. destruct units as [_ [_ [Za _]]]. unfold pixels_of.
  pose proof (cdiv_ge (c * (scale M * scale M)) (amount_unit I) Za). pose proof (Z.square_nonneg (scale M)). nia.
Qed.

(** More drones that are not listed change nothing. *)
Lemma others_more knee enough rest : 0 < knee -> all_nonneg rest ->
  forall q p, 0 <= q -> not_higher knee enough q p ->
  not_higher knee enough (q + sumZ (map (fun x => pixels_of (snd x)) rest)) (p + sumZ (map (else_of knee) rest)).
Proof.
  intros Hk. induction rest as [|x rest IH]; intros Hn q p H0 H; simpl; [rewrite !Z.add_0_r; exact H|].
  pose proof (Hn x (or_introl eq_refl)) as Hx. pose proof (pixels_of_nonneg _ Hx) as Hd.
  rewrite !Z.add_assoc. apply IH; [intros y Hy; apply Hn; right; exact Hy | lia|].
  destruct (root_of_square (snd x) Hx) as [Hr Hs]. destruct units as [_ [_ [Za _]]].
  assert (Hq : pixels_of (snd x) <= root_of (snd x) * root_of (snd x)).
  { unfold pixels_of, cdiv. enough (- (root_of (snd x) * root_of (snd x)) <= - (snd x * (scale M * scale M)) / amount_unit I) by lia.
    apply Z.div_le_lower_bound; [exact Za | lia]. }
  pose proof (cdiv_ge (pixels_of (snd x)) (2 * knee) ltac:(lia)) as Hl.
  apply one_stays; try assumption; unfold else_of, unlisted.
  - apply Z.min_glb; nia.
  - destruct (Z.min_spec (root_of (snd x)) (cdiv (pixels_of (snd x)) (2 * knee))) as [[_ ->] | [_ ->]]; lia.
Qed.

Lemma states_bound g enough knee sets vs : phis_ok g enough (States knee sets) = true -> all_nonneg vs -> of_team g vs ->
  not_higher knee enough (sumZ (map (fun x => pixels_of (snd x)) vs))
    (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) (Cut 0 0 (States knee sets))) vs)).
Proof.
  intros H Hn [_ [Hp Ha]]. cbn [phis_ok] in H. apply andb_true_iff in H. destruct H as [H Hc].
  apply andb_true_iff in H. destruct H as [Hk Hsets]. apply Z.ltb_lt in Hk.
  set (b := fun x : nat * state * Z => negb (snd x =? 0)).
  assert (Hsub : forall x, In x (filter b vs) -> In x vs) by (intros x Hx; apply filter_In in Hx; apply Hx).
  destruct (stand_apart knee g sets (filter b vs) Hsets (filter_pairs _ _ _ Hp) (fun x Hx => Hn x (Hsub x Hx))
              (fun x Hx => Ha x (Hsub x Hx))) as [ls [rest [H1 [H2 [H3 H4]]]]].
  pose proof (corners_sound knee enough _ (Z.lt_le_incl _ _ Hk) _ Hc (0, 0) (or_introl eq_refl) ls H1) as H5. cbn [fst snd] in H5.
  rewrite !Z.add_0_l in H5. pose proof (others_more knee enough rest Hk H2 _ _ (pixels_nonneg _ _ H1) H5) as H6. rewrite <- H3, <- H4 in H6.
  assert (Hz : forall x, In x (filter (fun x => negb (b x)) vs) -> snd x = 0).
  { intros x Hx. apply filter_In in Hx. destruct Hx as [_ Hx]. unfold b in Hx. rewrite negb_involutive in Hx.
    apply Z.eqb_eq. exact Hx. }
  rewrite (sumZ_filter b (fun x => pixels_of (snd x)) vs), (sumZ_filter b (fun x => cut_phi _ _ _ _ _) vs).
  rewrite (sumZ_zero (fun x => pixels_of (snd x)) (filter (fun x => negb (b x)) vs)).
  2:{ intros x Hx. rewrite (Hz x Hx). unfold pixels_of, cdiv. rewrite Z.mul_0_l. reflexivity. }
  rewrite (sumZ_zero (fun x => cut_phi _ _ _ _ _) (filter (fun x => negb (b x)) vs)).
  2:{ intros x Hx. unfold cut_phi. rewrite (Hz x Hx). reflexivity. }
  rewrite !Z.add_0_r.
  replace (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) (Cut 0 0 (States knee sets))) (filter b vs)))
    with (sumZ (map (phi_of knee sets) (filter b vs))); [exact H6|].
  apply sumZ_ext. intros x Hx. apply filter_In in Hx. destruct Hx as [_ Hx]. unfold b in Hx. apply negb_true_iff in Hx.
  unfold cut_phi. cbn [phis]. rewrite Hx. reflexivity.
Qed.

(** * What a cut bounds *)

Lemma curves_bound g c l vs : phis c = Curves l -> cut_ok g c = true -> all_nonneg vs ->
  map class_at vs = map fst (team I) ->
  (sqrt (sumR (parts vs)) * IZR (scale M)
   <= IZR (constant c) + IZR (sumZ (map (fun x => phi 0 0 (curve_in l (class_at x)) (root_of (snd x))) vs)))%R.
Proof.
  intros Hl Hc Hvs Hteam. real_units. unfold cut_ok in Hc. rewrite Hl in Hc. cbn [phis_ok] in Hc. split_andb. to_Z.
  set (item := fun x : nat * state * Z => (sqrt (IZR (snd x) / IZR (amount_unit I)) * IZR (scale M),
                 root_of (snd x), curve_in l (class_at x))%R).
  assert (Hitems : Forall item_ok (map item vs)).
  { apply Forall_forall. intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
    split; [apply root_of_ok, Hvs, Hy|].
    match goal with H : forallb _ l = true |- _ => rename H into HR end.
    clear - HR. induction l as [|[k' pts] cs IH]; [reflexivity|].
    simpl in HR. split_andb. simpl. destruct (Nat.eqb (class_at y) k'); auto. }
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
  set (at_ := combine (map class_at vs) cs).
  assert (Hlen : length vs = length cs).
  { apply Forall2_lengths in Hcs. rewrite map_length in Hcs. exact Hcs. }
  assert (Esnd : map snd at_ = cs).
  { unfold at_. clear - Hlen. revert cs Hlen. induction vs as [|x vs IH]; intros [|y cs] H; simpl in *;
      try discriminate; [reflexivity|]. f_equal. apply IH. lia. }
  assert (Efst : map fst at_ = map fst (team I)).
  { rewrite <- Hteam. unfold at_. clear - Hlen. revert cs Hlen. induction vs as [|x vs IH]; intros [|y cs] H; simpl in *;
      try discriminate; [reflexivity|]. f_equal. apply IH. lia. }
  assert (C1 : forall x, In x at_ -> In (snd x) ((0, 0) :: curve_in l (fst x))).
  { intros x Hx. unfold at_ in Hx. clear - Hcs Hx. revert cs Hcs Hx.
    induction vs as [|y vs IH]; intros [|z cs] Hcs Hx; simpl in *; try contradiction.
    apply Forall2_head in Hcs. destruct Hcs as [Hc Hcs]. destruct Hx as [<- | Hx]; [exact Hc|].
    exact (IH cs Hcs Hx). }
  assert (C2 : forall k, (length (filter (fun x => Nat.eqb k (fst x)) at_) <= size k)%nat).
  { intros k. unfold size. apply Nat.eq_le_incl.
    assert (E : forall A (m : list (nat * A)), length (filter (fun x => Nat.eqb k (fst x)) m)
                 = length (filter (Nat.eqb k) (map fst m))).
    { clear. intros A m. induction m as [|x m IH]; simpl; [reflexivity|].
      destruct (Nat.eqb k (fst x)); simpl; congruence. }
    rewrite !E, Efst. reflexivity. }
  destruct (placed_classes l at_ (conj C1 C2)) as [ls [C3 [C4 C5]]].
  assert (C6 : corners_ok 0 (constant c) (map crowd_of l) [(0, 0)] = true) by assumption.
  destruct (corners_sound _ _ _ (Z.le_refl 0) _ C6 (0, 0) (or_introl eq_refl) ls C3) as [C7 [C8 _]].
  cbn [fst snd] in C7, C8. rewrite C5 in C7. rewrite C4, C5, Z.add_0_l in C8. rewrite Esnd, Z.add_0_l in *.
  apply IZR_le in C8. rewrite mult_IZR in C8. apply IZR_nonneg in C7.
  assert (HS : (sqrt (0 + IZR (squares cs)) <= IZR (constant c + values cs))%R).
  { rewrite Rplus_0_l. rewrite <- (sqrt_square (IZR (constant c + values cs))) by exact C7.
    apply sqrt_le_1_alt. exact C8. }
  rewrite plus_IZR in HS. unfold squares, values in HS. lra.
Qed.

Lemma cut_bound g c vs : cut_ok g c = true -> all_nonneg vs -> of_team g vs ->
  (sqrt (sumR (parts vs)) * IZR (scale M)
   <= IZR (constant c)
      + IZR (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) c) vs)))%R.
Proof.
  intros Hc Hvs Ht. destruct (phis c) as [l | knee sets] eqn:E.
  - pose proof (curves_bound g c l vs E Hc Hvs (proj1 Ht)) as H.
    replace (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) c) vs))
      with (sumZ (map (fun x => phi 0 0 (curve_in l (class_at x)) (root_of (snd x))) vs)); [exact H|].
    apply sumZ_ext. intros x _. unfold cut_phi. rewrite E. reflexivity.
  - unfold cut_ok in Hc. rewrite E in Hc. apply andb_true_iff in Hc. destruct Hc as [_ Hc].
    pose proof (states_bound g _ knee sets vs Hc Hvs Ht) as H.
    replace (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) (Cut 0 0 (States knee sets))) vs))
      with (sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) c) vs)) in H.
    2:{ apply sumZ_ext. intros x _. unfold cut_phi. rewrite E. reflexivity. }
    destruct H as [H1 [H2 _]]. rewrite <- plus_IZR. apply root_below; [exact H1 | apply sumR_nonneg, parts_nonneg, Hvs|].
    apply IZR_le in H2. eapply Rle_trans; [|exact H2]. real_units.
    unfold parts. rewrite IZR_sumZ, Rmult_comm, <- sumR_scale. apply sumR_le. intros x _.
    pose proof (cdiv_R (snd x * (scale M * scale M)) (amount_unit I) Za) as H3. fold (pixels_of (snd x)) in H3.
    eapply Rle_trans; [|exact H3]. apply Req_le. rewrite !mult_IZR. field. lra.
Qed.

(** The inequality of a group: its worth is at most what its viewers are paid and its constant. *)
Lemma group_bound g vs : group_ok g = true -> all_nonneg vs ->
  (over_time M = true \/ of_team g vs) ->
  (worth I g (sumZ (map snd vs))
   <= IZR (sumZ (map (fun x => pay (class_at x) (state_at x) (g, snd x)) vs)) / IZR pay_unit
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
  set (sums := fun c => sumZ (map (fun x => cut_phi (class_at x) (state_at x) (snd x) (root_of (snd x)) c) vs)).
  set (roots := sumZ (map (fun x => root_of (snd x)) vs)).
  (* what is paid, as a real *)
  assert (Epay : (IZR (sumZ (map (fun x => pay (class_at x) (state_at x) (g, snd x)) vs)) / IZR pay_unit
    = W * (A * (IZR roots / IZR (scale M)) + B * sumR (parts vs)
           + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (sums c) / IZR (scale M))) (cuts p))))%R).
  { assert (E : sumZ (map (fun x => pay (class_at x) (state_at x) (g, snd x)) vs)
        = w * (amount_unit I * (alpha p * roots + sumZ (map (fun c => share c * sums c) (cuts p)))
               + scale M * (beta p * sumZ (map snd vs)))).
    { unfold pay. fold p w. rewrite sumZ_scale. f_equal. rewrite sumZ_add, !sumZ_scale. f_equal. f_equal.
      rewrite sumZ_add, sumZ_scale. f_equal. rewrite sumZ_swap. apply sumZ_ext. intros c Hc.
      unfold cut_pay, sums. rewrite sumZ_scale. reflexivity. }
    rewrite E, Hsum. clear E.
    replace (sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (sums c) / IZR (scale M))) (cuts p))%R)
      with (IZR (sumZ (map (fun c => share c * sums c)%Z (cuts p))) / (IZR (scale M) * IZR (scale M)))%R.
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
    assert (Hcuts : forall c, In c (cuts p) -> cut_ok g c = true).
    { match goal with H : forallb (cut_ok g) _ = true |- _ => rewrite forallb_forall in H; exact H end. }
    assert (Hover : over_time M = false \/ cuts p = []).
    { destruct (over_time M); [|left; reflexivity]. right. destruct (cuts p); [reflexivity | discriminate]. }
    set (r := sqrt (sumR (parts vs))) in *.
    assert (Hr : (0 <= r)%R) by apply sqrt_pos.
    assert (Hcut : ((1 - REST) * r <= CUTS
       + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (sums c) / IZR (scale M))) (cuts p)))%R).
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
      pose proof (cut_bound g c vs Hok Hvs Ht) as CB. fold r in CB. fold (sums c) in CB.
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
       + sumR (map (fun c => IZR (share c) / IZR (scale M) * (IZR (sums c) / IZR (scale M)))%R (cuts p)) + (K + CUTS)))%R.
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
