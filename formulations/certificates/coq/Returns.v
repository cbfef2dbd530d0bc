(** Inequalities over the reals: what is seen together is worth no more than what each is paid. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz.
From CocapCheck Require Import Spec Sums.
Import ListNotations.
Open Scope R_scope.

Definition nonneg (l : list R) := Forall (fun c => 0 <= c) l.

(** * Returns are subadditive, and gains shrink *)

Lemma sqrt_subadditive a b : 0 <= a -> 0 <= b -> sqrt (a + b) <= sqrt a + sqrt b.
Proof.
  intros Ha Hb. pose proof (sqrt_pos a). pose proof (sqrt_pos b).
  apply Rsqr_incr_0_var; [|lra].
  unfold Rsqr. rewrite sqrt_sqrt by lra.
  pose proof (sqrt_sqrt a Ha). pose proof (sqrt_sqrt b Hb). nra.
Qed.

Definition is_return (r : return_of) : Prop :=
  match r with Root => True | AtMost k => (0 <= k)%Z end.

Lemma return_subadditive r a b : is_return r -> 0 <= a -> 0 <= b ->
  return_value r (a + b) <= return_value r a + return_value r b.
Proof.
  destruct r as [|k]; simpl; intros Hr Ha Hb; [apply sqrt_subadditive; assumption|].
  apply IZR_le in Hr. unfold Rmin.
  destruct (Rle_dec (a + b) (IZR k)), (Rle_dec a (IZR k)), (Rle_dec b (IZR k)); lra.
Qed.

Lemma return_zero r : is_return r -> return_value r 0 = 0.
Proof.
  destruct r as [|k]; simpl; intros Hr; [apply sqrt_0|].
  apply IZR_le in Hr. unfold Rmin. destruct (Rle_dec 0 (IZR k)); lra.
Qed.

Lemma return_sum r l : is_return r -> nonneg l ->
  return_value r (sumR l) <= sumR (map (return_value r) l).
Proof.
  intros Hr. induction 1; simpl; [rewrite return_zero by assumption; lra|].
  pose proof (return_subadditive r x (sumR l) Hr H (sumR_nonneg _ H0)). lra.
Qed.

Lemma return_nonneg r z : is_return r -> 0 <= z -> 0 <= return_value r z.
Proof.
  destruct r as [|k]; simpl; intros Hr Hz; [apply sqrt_pos|].
  apply IZR_le in Hr. unfold Rmin. destruct (Rle_dec z (IZR k)); lra.
Qed.

Lemma return_monotone r a b : 0 <= a <= b -> return_value r a <= return_value r b.
Proof.
  destruct r as [|k]; simpl; intros H; [apply sqrt_le_1_alt; lra|].
  unfold Rmin. destruct (Rle_dec a (IZR k)), (Rle_dec b (IZR k)); lra.
Qed.

(** What is added is worth less where more is there already. *)
Lemma return_shrinks r x e c : 0 <= x -> 0 <= e -> 0 <= c ->
  return_value r (x + e + c) - return_value r (x + e) <= return_value r (x + c) - return_value r x.
Proof.
  intros Hx He Hc. destruct r as [|k]; simpl.
  - pose proof (sqrt_sqrt (x + e + c) ltac:(lra)) as A. pose proof (sqrt_sqrt (x + e) ltac:(lra)) as B.
    pose proof (sqrt_sqrt (x + c) ltac:(lra)) as P. pose proof (sqrt_sqrt x Hx) as Q.
    pose proof (sqrt_le_1_alt (x + c) (x + e + c) ltac:(lra)) as AP.
    pose proof (sqrt_le_1_alt x (x + e) ltac:(lra)) as BQ.
    pose proof (sqrt_le_1_alt x (x + c) ltac:(lra)) as PQ.
    pose proof (sqrt_le_1_alt (x + e) (x + e + c) ltac:(lra)) as AB.
    pose proof (sqrt_pos x) as Q0.
    set (a := sqrt (x + e + c)) in *. set (b := sqrt (x + e)) in *.
    set (p := sqrt (x + c)) in *. set (q := sqrt x) in *.
    destruct (Rle_dec (a - b) (p - q)) as [L | G]; [exact L|]. exfalso. apply Rnot_le_lt in G.
    assert (E : (a - b) * (a + b) = (p - q) * (p + q)) by (ring_simplify; lra).
    assert (H1 : (a - b) * (p + q) <= (a - b) * (a + b)) by (apply Rmult_le_compat_l; lra).
    destruct (Rle_lt_or_eq_dec 0 (p + q) ltac:(lra)) as [S | S].
    + assert ((p - q) * (p + q) < (a - b) * (p + q)) by (apply Rmult_lt_compat_r; lra). lra.
    + assert (p = 0 /\ q = 0) as [P0 Q0'] by lra. rewrite P0, Q0' in *.
      assert (0 < (a - b) * (a + b)) by (apply Rmult_lt_0_compat; lra). lra.
  - unfold Rmin. destruct (Rle_dec (x + e + c) (IZR k)), (Rle_dec (x + e) (IZR k)),
      (Rle_dec (x + c) (IZR k)), (Rle_dec x (IZR k)); lra.
Qed.

(** * Multipliers *)

Lemma sqrt_sum l : nonneg l -> sqrt (sumR l) <= sumR (map sqrt l).
Proof. apply (return_sum Root). exact I. Qed.

(** A share [rest] of the root: rest r <= alpha r + beta r^2 + kappa. *)
Lemma root_bound l rest alpha beta kappa :
  nonneg l -> 0 <= alpha -> 0 <= beta -> 0 <= kappa ->
  (rest <= alpha \/ 0 < beta /\ (rest - alpha) * (rest - alpha) <= 4 * beta * kappa) ->
  rest * sqrt (sumR l) <= alpha * sumR (map sqrt l) + beta * sumR l + kappa.
Proof.
  intros Hl Ha Hb Hk H.
  pose proof (sqrt_sum l Hl) as Hs.
  pose proof (sumR_nonneg l Hl) as Hn.
  pose proof (sqrt_pos (sumR l)) as Hr.
  pose proof (sqrt_sqrt _ Hn) as Hq.
  set (r := sqrt (sumR l)) in *. set (s := sumR (map sqrt l)) in *.
  rewrite <- Hq.
  assert (alpha * r <= alpha * s) by (apply Rmult_le_compat_l; lra).
  enough (rest * r <= alpha * r + beta * (r * r) + kappa) by lra.
  destruct H as [H | [Hb' H]].
  - assert (0 <= beta * (r * r)) by (apply Rmult_le_pos; nra). nra.
  - (* 4 beta (beta r^2 - (rest - alpha) r + kappa) >= (2 beta r - (rest - alpha))^2 *)
    assert (0 <= 4 * beta * (beta * (r * r) - (rest - alpha) * r + kappa)).
    { pose proof (Rle_0_sqr (2 * beta * r - (rest - alpha))) as Hsq. unfold Rsqr in Hsq. nra. }
    assert (0 <= beta * (r * r) - (rest - alpha) * r + kappa).
    { apply Rmult_le_reg_l with (4 * beta); lra. }
    lra.
Qed.

(** Drones that are counted up to k. *)
Lemma count_bound z k beta kappa :
  0 <= z -> 0 <= k -> 0 <= beta -> 0 <= kappa -> k * (1 - beta) <= kappa ->
  Rmin z k <= beta * z + kappa.
Proof.
  intros Hz Hk Hb Hka H. unfold Rmin. destruct (Rle_dec z k) as [L | G].
  - destruct (Rle_dec 1 beta) as [O | O]; [nra|].
    assert (z * (1 - beta) <= k * (1 - beta)) by (apply Rmult_le_compat_r; lra). lra.
  - assert (beta * k <= beta * z) by (apply Rmult_le_compat_l; lra). lra.
Qed.

(** * Cuts: a root less functions that are straight between breakpoints is largest at them *)

(** The function through (r0, v0) and the points, of slope 1 after the last, rounded up. *)
Fixpoint phi (r0 v0 : Z) (points : list (Z * Z)) (x : Z) : Z :=
  match points with
  | [] => v0 + (x - r0)
  | (r, v) :: rest =>
      if (x <=? r)%Z then v0 + cdiv ((x - r0) * (v - v0)) (r - r0) else phi r v rest x
  end.

Fixpoint rising (r0 : Z) (points : list (Z * Z)) : bool :=
  match points with [] => true | (r, _) :: rest => (r0 <? r)%Z && rising r rest end.

Lemma norm_convex q a b l : 0 <= q -> 0 <= a -> 0 <= b -> 0 <= l <= 1 ->
  sqrt (q + ((1 - l) * a + l * b) * ((1 - l) * a + l * b))
  <= (1 - l) * sqrt (q + a * a) + l * sqrt (q + b * b).
Proof.
  intros Hq Ha Hb Hl.
  assert (Ea : 0 <= q + a * a) by nra. assert (Eb : 0 <= q + b * b) by nra.
  pose proof (sqrt_pos (q + a * a)) as Pa. pose proof (sqrt_pos (q + b * b)) as Pb.
  pose proof (sqrt_sqrt _ Ea) as Sa. pose proof (sqrt_sqrt _ Eb) as Sb.
  set (x := sqrt (q + a * a)) in *. set (y := sqrt (q + b * b)) in *.
  assert (C : q + a * b <= x * y).
  { apply Rsqr_incr_0_var; [|nra]. unfold Rsqr.
    replace (x * y * (x * y)) with (x * x * (y * y)) by ring. rewrite Sa, Sb.
    pose proof (Rmult_le_pos _ _ Hq (Rle_0_sqr (a - b))) as D. unfold Rsqr in D. nra. }
  apply Rsqr_incr_0_var.
  2:{ apply Rplus_le_le_0_compat; apply Rmult_le_pos; lra. }
  unfold Rsqr. rewrite sqrt_sqrt.
  2:{ pose proof (Rle_0_sqr ((1 - l) * a + l * b)) as D. unfold Rsqr in D. lra. }
  assert (0 <= 2 * (l * (1 - l)) * (x * y - (q + a * b))).
  { apply Rmult_le_pos; [|lra]. apply Rmult_le_pos; [lra|]. apply Rmult_le_pos; lra. }
  replace (((1 - l) * x + l * y) * ((1 - l) * x + l * y))
    with ((1 - l) * (1 - l) * (x * x) + l * l * (y * y) + 2 * (l * (1 - l)) * (x * y)) by ring.
  rewrite Sa, Sb. nra.
Qed.

Lemma norm_slope q a x : 0 <= q -> 0 <= a <= x ->
  sqrt (q + x * x) <= sqrt (q + a * a) + (x - a).
Proof.
  intros Hq Ha. assert (Ea : 0 <= q + a * a) by nra.
  pose proof (sqrt_pos (q + a * a)) as Pa. pose proof (sqrt_sqrt _ Ea) as Sa.
  assert (a <= sqrt (q + a * a)).
  { apply Rsqr_incr_0_var; [unfold Rsqr; rewrite Sa; lra | lra]. }
  apply Rsqr_incr_0_var; [|lra]. unfold Rsqr. rewrite sqrt_sqrt by nra. nra.
Qed.

Lemma phi_corner points : forall r0 v0 x q,
  rising r0 points = true -> (0 <= r0 <= x)%Z -> 0 <= q ->
  exists b v, In (b, v) ((r0, v0) :: points) /\
    sqrt (q + IZR x * IZR x) - IZR (phi r0 v0 points x) <= sqrt (q + IZR b * IZR b) - IZR v.
Proof.
  induction points as [|[r v] points IH]; intros r0 v0 x q Hr [H0 Hx] Hq; simpl in Hr.
  - exists r0, v0. split; [left; reflexivity|]. simpl. rewrite plus_IZR, minus_IZR.
    apply IZR_le in H0, Hx. pose proof (norm_slope q (IZR r0) (IZR x) Hq (conj H0 Hx)). lra.
  - split_andb. to_Z. simpl. destruct (Z.leb_spec x r) as [L | G].
    + assert (Hd : (0 < r - r0)%Z) by lia.
      pose proof (cdiv_R ((x - r0) * (v - v0)) (r - r0) Hd) as HC.
      rewrite mult_IZR, !minus_IZR in HC.
      set (c := cdiv ((x - r0) * (v - v0)) (r - r0)) in *. rewrite plus_IZR.
      apply IZR_lt in Hd. rewrite minus_IZR in Hd. pose proof (IZR_le _ _ H0) as H0'. simpl in H0'.
      apply IZR_le in Hx, L.
      set (l := (IZR x - IZR r0) / (IZR r - IZR r0)).
      assert (Hl : 0 <= l <= 1).
      { unfold l. split.
        - apply Rmult_le_pos; [lra|]. apply Rlt_le, Rinv_0_lt_compat. lra.
        - apply Rmult_le_reg_r with (IZR r - IZR r0); [lra|]. unfold Rdiv.
          rewrite Rmult_assoc, Rinv_l by lra. lra. }
      assert (Ex : IZR x = (1 - l) * IZR r0 + l * IZR r).
      { unfold l. field. lra. }
      assert (HC' : l * (IZR v - IZR v0) <= IZR c).
      { replace (l * (IZR v - IZR v0)) with ((IZR x - IZR r0) * (IZR v - IZR v0) / (IZR r - IZR r0));
          [exact HC | unfold l; field; lra]. }
      pose proof (norm_convex q (IZR r0) (IZR r) l Hq ltac:(lra) ltac:(lra) Hl) as N.
      rewrite <- Ex in N.
      destruct (Rle_dec (sqrt (q + IZR r * IZR r) - IZR v) (sqrt (q + IZR r0 * IZR r0) - IZR v0)) as [A | A].
      * exists r0, v0. split; [left; reflexivity|]. nra.
      * exists r, v. split; [right; left; reflexivity|]. nra.
    + destruct (IH r v x q) as [b [w [Hin Hle]]]; [assumption | lia | assumption |].
      exists b, w. split; [right; exact Hin | exact Hle].
Qed.

(** What a drone has of a group: its root, that root rounded up, and its function. *)
Definition root_item : Type := R * Z * list (Z * Z).
Definition item_ok (i : root_item) : Prop :=
  let '(s, hi, points) := i in 0 <= s <= IZR hi /\ rising 0 points = true.
Definition squared (i : root_item) : R := let '(s, _, _) := i in s * s.
Definition item_phi (i : root_item) : Z := let '(_, hi, points) := i in phi 0 0 points hi.
Definition is_corner (i : root_item) (c : Z * Z) : Prop := let '(_, _, points) := i in In c ((0, 0)%Z :: points).

Lemma squared_nonneg l : Forall item_ok l -> 0 <= sumR (map squared l).
Proof.
  intros H. apply sumR_nonneg. apply Forall_forall.
  intros x Hx. apply in_map_iff in Hx. destruct Hx as [[[s hi] points] [<- Hin]]. rewrite Forall_forall in H. specialize (H _ Hin). simpl in *. nra.
Qed.

Lemma corners_exist l : forall q, Forall item_ok l -> 0 <= q ->
  exists cs, Forall2 is_corner l cs /\
    sqrt (q + sumR (map squared l)) - IZR (sumZ (map item_phi l))
    <= sqrt (q + IZR (sumZ (map (fun c => fst c * fst c)%Z cs))) - IZR (sumZ (map snd cs)).
Proof.
  induction l as [|[[s hi] points] l IH]; intros q Hok Hq.
  - exists []. split; [constructor|]. simpl. lra.
  - apply Forall_cons_iff in Hok. destruct Hok as [[Hs Hr] Hl].
    pose proof (squared_nonneg l Hl) as Hn.
    assert (HS : (0 <= 0 <= hi)%Z) by (split; [lia | apply le_IZR; lra]).
    destruct (phi_corner points 0 0 hi (q + sumR (map squared l)) Hr HS ltac:(lra)) as [b [v [Hin Hle]]].
    destruct (IH (q + IZR b * IZR b) Hl ltac:(nra)) as [cs [Hcs Hle']].
    exists ((b, v) :: cs). split; [constructor; [exact Hin | exact Hcs]|].
    simpl. rewrite !plus_IZR, mult_IZR.
    assert (sqrt (q + (s * s + sumR (map squared l))) <= sqrt (q + sumR (map squared l) + IZR hi * IZR hi)).
    { apply sqrt_le_1_alt. nra. }
    replace (q + sumR (map squared l) + IZR b * IZR b) with (q + IZR b * IZR b + sumR (map squared l)) in Hle by ring.
    replace (q + (IZR b * IZR b + IZR (sumZ (map (fun c : Z * Z => (fst c * fst c)%Z) cs))))
      with (q + IZR b * IZR b + IZR (sumZ (map (fun c : Z * Z => (fst c * fst c)%Z) cs))) by ring.
    lra.
Qed.
