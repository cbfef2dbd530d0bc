(** Sums of integers and reals. *)
From Coq Require Import ZArith List Bool Reals Lra Lia FinFun.
From CocapCheck Require Import Spec.
Import ListNotations.
Open Scope Z_scope.

Ltac split_andb := repeat match goal with
  | H : _ && _ = true |- _ => apply andb_true_iff in H; destruct H
  end.
Ltac to_Z := repeat match goal with
  | H : (_ <=? _) = true |- _ => apply Z.leb_le in H
  | H : (_ <? _) = true |- _ => apply Z.ltb_lt in H
  | H : (_ =? _) = true |- _ => apply Z.eqb_eq in H
  end.

Lemma sumZ_app a b : sumZ (a ++ b) = sumZ a + sumZ b.
Proof. induction a; simpl; lia. Qed.

Lemma sumZ_le {A} (f g : A -> Z) l : (forall x, In x l -> f x <= g x) ->
  sumZ (map f l) <= sumZ (map g l).
Proof.
  induction l; simpl; intros H; [lia|].
  pose proof (H a (or_introl eq_refl)). pose proof (IHl (fun x Hx => H x (or_intror Hx))). lia.
Qed.

Lemma sumZ_ext {A} (f g : A -> Z) l : (forall x, In x l -> f x = g x) ->
  sumZ (map f l) = sumZ (map g l).
Proof.
  intros H. f_equal. apply map_ext_in. exact H.
Qed.

Lemma sumZ_zero {A} (f : A -> Z) l : (forall x, In x l -> f x = 0) -> sumZ (map f l) = 0.
Proof.
  induction l; simpl; intros H; [lia|]. rewrite IHl by auto. rewrite H by auto. lia.
Qed.

Lemma sumZ_nonneg {A} (f : A -> Z) l : (forall x, In x l -> 0 <= f x) -> 0 <= sumZ (map f l).
Proof.
  induction l; simpl; intros H; [lia|]. pose proof (H a (or_introl eq_refl)).
  pose proof (IHl (fun x Hx => H x (or_intror Hx))). lia.
Qed.

Lemma sumZ_add {A} (f g : A -> Z) l :
  sumZ (map (fun x => f x + g x) l) = sumZ (map f l) + sumZ (map g l).
Proof. induction l; simpl; lia. Qed.

Lemma sumZ_scale {A} (f : A -> Z) c l : sumZ (map (fun x => c * f x) l) = c * sumZ (map f l).
Proof. induction l; simpl; lia. Qed.

Lemma sumZ_swap {A B} (f : A -> B -> Z) la lb :
  sumZ (map (fun a => sumZ (map (f a) lb)) la) = sumZ (map (fun b => sumZ (map (fun a => f a b) la)) lb).
Proof.
  induction la; simpl.
  - induction lb; simpl; lia.
  - rewrite IHla, <- sumZ_add. reflexivity.
Qed.

Lemma sumZ_filter {A} (b : A -> bool) (f : A -> Z) l :
  sumZ (map f l) = sumZ (map f (filter b l)) + sumZ (map f (filter (fun x => negb (b x)) l)).
Proof. induction l as [|a l IH]; simpl; [lia|]. destruct (b a); simpl; lia. Qed.

Lemma sumZ_flat_map {A B} (f : A -> list B) (g : B -> Z) l :
  sumZ (map g (flat_map f l)) = sumZ (map (fun a => sumZ (map g (f a))) l).
Proof. induction l; simpl; [reflexivity|]. rewrite map_app, sumZ_app. lia. Qed.

(** * Sums over steps *)

Lemma total_seq n f : total n f = sumZ (map f (seq 0 n)).
Proof.
  induction n; simpl total; [reflexivity|].
  rewrite seq_S, map_app, sumZ_app, IHn. simpl. lia.
Qed.

Lemma total_ext n f g : (forall t, (t < n)%nat -> f t = g t) -> total n f = total n g.
Proof. induction n; simpl; intros H; [lia|]. rewrite IHn by (intros; apply H; lia). rewrite H; lia. Qed.

Lemma total_le n f g : (forall t, (t < n)%nat -> f t <= g t) -> total n f <= total n g.
Proof.
  induction n; simpl; intros H; [lia|]. pose proof (IHn (fun t Ht => H t ltac:(lia))).
  pose proof (H n ltac:(lia)). lia.
Qed.

Lemma total_add n f g : total n (fun t => f t + g t) = total n f + total n g.
Proof. induction n; simpl; lia. Qed.

Lemma total_scale n c f : total n (fun t => c * f t) = c * total n f.
Proof. induction n; simpl; lia. Qed.

Lemma total_zero n f : (forall t, (t < n)%nat -> f t = 0) -> total n f = 0.
Proof. induction n; simpl; intros H; [lia|]. rewrite IHn by (intros; apply H; lia). rewrite H; lia. Qed.

Lemma total_sum {A} n (f : nat -> A -> Z) l :
  total n (fun t => sumZ (map (f t) l)) = sumZ (map (fun x => total n (fun t => f t x)) l).
Proof.
  induction n; simpl.
  - symmetry. apply sumZ_zero. reflexivity.
  - rewrite IHn, <- sumZ_add. reflexivity.
Qed.

Lemma total_pick n t0 f :
  total n (fun t => if Nat.eqb t0 t then f t else 0) = if Nat.ltb t0 n then f t0 else 0.
Proof.
  induction n; simpl; [reflexivity|]. rewrite IHn.
  destruct (Nat.ltb_spec t0 n), (Nat.ltb_spec t0 (S n)), (Nat.eqb_spec t0 n); subst; try lia.
Qed.

(** * Sums of reals *)

Lemma sumR_app a b : sumR (a ++ b) = (sumR a + sumR b)%R.
Proof. induction a; simpl; lra. Qed.

Lemma sumR_le {A} (f g : A -> R) l : (forall x, In x l -> (f x <= g x)%R) ->
  (sumR (map f l) <= sumR (map g l))%R.
Proof.
  induction l; simpl; intros H; [lra|].
  pose proof (H a (or_introl eq_refl)). pose proof (IHl (fun x Hx => H x (or_intror Hx))). lra.
Qed.

Lemma sumR_ext {A} (f g : A -> R) l : (forall x, In x l -> f x = g x) ->
  sumR (map f l) = sumR (map g l).
Proof. intros H. f_equal. apply map_ext_in. exact H. Qed.

Lemma sumR_nonneg l : Forall (fun c => 0 <= c)%R l -> (0 <= sumR l)%R.
Proof. induction 1; simpl; lra. Qed.

Lemma sumR_zero {A} (f : A -> R) l : (forall x, In x l -> f x = 0%R) -> sumR (map f l) = 0%R.
Proof. induction l; simpl; intros H; [lra|]. rewrite IHl by auto. rewrite H by auto. lra. Qed.

Lemma sumR_add {A} (f g : A -> R) l :
  sumR (map (fun x => f x + g x)%R l) = (sumR (map f l) + sumR (map g l))%R.
Proof. induction l; simpl; lra. Qed.

Lemma sumR_scale {A} (f : A -> R) c l : sumR (map (fun x => c * f x)%R l) = (c * sumR (map f l))%R.
Proof. induction l; simpl; lra. Qed.

Lemma sumR_swap {A B} (f : A -> B -> R) la lb :
  sumR (map (fun a => sumR (map (f a) lb)) la) = sumR (map (fun b => sumR (map (fun a => f a b) la)) lb).
Proof.
  induction la; simpl.
  - induction lb; simpl; lra.
  - rewrite IHla, <- sumR_add. reflexivity.
Qed.

Lemma sumR_next (f : nat -> R) n : sumR (map f (seq 0 (S n))) = (sumR (map f (seq 0 n)) + f n)%R.
Proof. rewrite seq_S, map_app, sumR_app. simpl. lra. Qed.

Lemma sumR_from (f : nat -> R) a n : sumR (map f (seq a n)) = sumR (map (fun i => f (a + i)%nat) (seq 0 n)).
Proof.
  f_equal. revert a. induction n as [|n IH]; intros a; [reflexivity|]. simpl. rewrite Nat.add_0_r. f_equal.
  rewrite IH, <- seq_shift, map_map. apply map_ext. intros i. f_equal. lia.
Qed.

(** Numbers with limits, and with lower ones for some two in a row, no two of which share a number. *)
Lemma sumR_less (f c : nat -> R) (d : nat -> Z) n :
  (forall i, (i < n)%nat -> (f i <= c i)%R) ->
  (forall i, (S i < n)%nat -> (f i + f (S i) <= c i + c (S i) - IZR (d i))%R) ->
  (forall i, d i = 0 \/ d (S i) = 0) ->
  (sumR (map f (seq 0 n)) <= sumR (map c (seq 0 n)) - IZR (total (pred n) d))%R.
Proof.
  intros H1 H2 Hd.
  enough (H : forall m, (m <= n)%nat -> (sumR (map f (seq 0 m)) <= sumR (map c (seq 0 m)) - IZR (total (pred m) d))%R
    /\ ((S m <= n)%nat -> (sumR (map f (seq 0 (S m))) <= sumR (map c (seq 0 (S m))) - IZR (total m d))%R)) by apply (H n (le_n _)).
  induction m as [|m IH]; intros Hm.
  - split; [simpl; lra|]. intros H. specialize (H1 O ltac:(lia)). simpl. lra.
  - destruct (IH ltac:(lia)) as [A B]. specialize (B Hm). split; [exact B|]. intros Hm2.
    rewrite (sumR_next f (S m)), (sumR_next c (S m)). cbn [total]. rewrite plus_IZR.
    destruct (Z.eq_dec (d m) 0) as [E | E]; [rewrite E; specialize (H1 (S m) Hm2); lra|].
    specialize (H2 m Hm2). rewrite (sumR_next f m), (sumR_next c m).
    enough (IZR (total m d) = IZR (total (pred m) d)) by lra.
    destruct m as [|m]; [reflexivity|]. cbn [pred total]. destruct (Hd m) as [E' | E']; [|contradiction]. rewrite E'. f_equal. lia.
Qed.

Lemma IZR_total n (f : nat -> Z) : IZR (total n f) = sumR (map (fun t => IZR (f t)) (seq 0 n)).
Proof. rewrite total_seq. induction (seq 0 n); simpl; [reflexivity|]. rewrite plus_IZR, IHl. reflexivity. Qed.

Lemma IZR_sumZ {A} (f : A -> Z) l : IZR (sumZ (map f l)) = sumR (map (fun x => IZR (f x)) l).
Proof. induction l; simpl; [reflexivity|]. rewrite plus_IZR, IHl. reflexivity. Qed.

(** * Fractions *)

Lemma IZR_pos z : 0 < z -> (0 < IZR z)%R.
Proof. apply IZR_lt. Qed.

Lemma IZR_nonneg z : 0 <= z -> (0 <= IZR z)%R.
Proof. apply IZR_le. Qed.

Lemma frac_nonneg a b : 0 <= a -> 0 < b -> (0 <= IZR a / IZR b)%R.
Proof.
  intros Ha Hb. apply IZR_nonneg in Ha. apply IZR_pos in Hb.
  apply Rmult_le_pos; [assumption|]. apply Rlt_le, Rinv_0_lt_compat. assumption.
Qed.

(** Division of integers, rounded up. *)
Definition cdiv (a b : Z) : Z := - ((- a) / b).

Lemma cdiv_ge a b : 0 < b -> a <= cdiv a b * b.
Proof.
  intros Hb. unfold cdiv. pose proof (Z.mul_div_le (- a) b Hb). nia.
Qed.

Lemma cdiv_R a b : 0 < b -> (IZR a / IZR b <= IZR (cdiv a b))%R.
Proof.
  intros Hb. pose proof (cdiv_ge a b Hb) as H. apply IZR_le in H. rewrite mult_IZR in H.
  apply IZR_pos in Hb. apply Rmult_le_reg_r with (IZR b); [assumption|].
  unfold Rdiv. rewrite Rmult_assoc, Rinv_l by lra. lra.
Qed.

(** * Lists side by side *)

Lemma Forall2_lengths {A B} (P : A -> B -> Prop) la lb : Forall2 P la lb -> length la = length lb.
Proof. induction 1; simpl; congruence. Qed.

Lemma Forall2_head {A B} (P : A -> B -> Prop) a b la lb :
  Forall2 P (a :: la) (b :: lb) -> P a b /\ Forall2 P la lb.
Proof. intros H. inversion H; auto. Qed.

Lemma Forall2_in {A B} (P : A -> B -> Prop) la lb : Forall2 P la lb ->
  Forall2 (fun a b => P a b /\ In a la /\ In b lb) la lb.
Proof.
  assert (H : forall l m, Forall2 P l m -> (forall a, In a l -> In a la) -> (forall b, In b m -> In b lb) ->
    Forall2 (fun a b => P a b /\ In a la /\ In b lb) l m).
  { induction 1 as [|a b l m Hab HF IH]; intros Hl Hm; constructor.
    - split; [exact Hab|]. split; [apply Hl | apply Hm]; left; reflexivity.
    - apply IH; [intros; apply Hl | intros; apply Hm]; right; assumption. }
  intros HF. apply H; auto.
Qed.

Lemma Forall2_weaken {A B} (P Q : A -> B -> Prop) la lb : (forall a b, P a b -> Q a b) ->
  Forall2 P la lb -> Forall2 Q la lb.
Proof. intros HPQ. induction 1; constructor; auto. Qed.

(** * Pairs of a list *)

Lemma pairs_weaken {A} (P Q : A -> A -> Prop) l : ForallOrdPairs P l -> (forall a b, P a b -> Q a b) ->
  ForallOrdPairs Q l.
Proof.
  intros H HPQ. induction H as [|x l Hx H IH]; constructor; [|exact IH].
  eapply Forall_impl; [|exact Hx]. intros y. apply HPQ.
Qed.

Lemma map_pairs {A B} (P : B -> B -> Prop) (f : A -> B) l :
  ForallOrdPairs (fun a b => P (f a) (f b)) l -> ForallOrdPairs P (map f l).
Proof. induction 1 as [|x l Hx H IH]; simpl; constructor; [apply Forall_map; exact Hx | exact IH]. Qed.

Lemma filter_pairs {A} (P : A -> A -> Prop) b l : ForallOrdPairs P l -> ForallOrdPairs P (filter b l).
Proof.
  induction 1 as [|x l Hx H IH]; [constructor|]. simpl. destruct (b x); [|exact IH]. constructor; [|exact IH].
  apply Forall_forall. intros y Hy. apply filter_In in Hy. rewrite Forall_forall in Hx. apply Hx, Hy.
Qed.
