(** Groups of a step in coarse numbers: what is seen of them, and what one more drone gains.

    Gains only shrink as more is seen. Numbers that bound are rounded up; what is seen is rounded
    down. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz.
From CocapCheck Require Import Spec Sums Returns.
Import ListNotations.
Open Scope Z_scope.

(** A group: its weight, the same as a factor of coarse returns, rounded up, and its return. *)
Record spec := Spec { s_weight : Z; s_factor : Z; s_return : return_of }.

Section Gains.
Variables (amount_unit weight_unit precision coarse : Z).
Hypothesis amount_unit_pos : 0 < amount_unit.
Hypothesis weight_unit_pos : 0 < weight_unit.
Hypothesis precision_pos : 0 < precision.
Hypothesis coarse_pos : 0 < coarse.

Definition spec_of (w : Z) (r : return_of) : spec := Spec w (cdiv (precision * w) (weight_unit * coarse)) r.
Definition coarse_up (c : Z) : Z := if c =? 0 then 0 else cdiv (c * coarse) amount_unit.

(** * Coarse returns *)

Definition root_up (n : Z) : Z :=
  let r := Z.sqrt n + 1 in if (0 <=? r) && (n <=? r * r) then r else n.
Definition root_down (n : Z) : Z :=
  let r := Z.sqrt n in if (0 <=? r) && (r * r <=? n) then r else 0.

Definition return_up (r : return_of) (n : Z) : Z :=
  match r with Root => root_up (n * coarse) | AtMost k => Z.min n (k * coarse) end.
Definition return_down (r : return_of) (n : Z) : Z :=
  match r with Root => root_down (n * coarse) | AtMost k => Z.min n (k * coarse) end.

(** What is seen so far of each group: at least so much, and its return, both coarse. *)
Definition so_far_of : Type := list (Z * Z).

Fixpoint gain (ss : list spec) (seen : so_far_of) (cs : list Z) : Z :=
  match ss, seen, cs with
  | s :: ss', (z, r) :: seen', c :: cs' =>
      if c =? 0 then gain ss' seen' cs'
      else s_factor s * (return_up (s_return s) (z + c) - r) + gain ss' seen' cs'
  | _, _, _ => 0
  end.

Fixpoint see (ss : list spec) (seen : so_far_of) (cs : list Z) : so_far_of :=
  match ss, seen, cs with
  | s :: ss', (z, r) :: seen', c :: cs' =>
      (if c =? 0 then (z, r) else let z' := z + c - 1 in (z', return_down (s_return s) z')) :: see ss' seen' cs'
  | _, _, _ => []
  end.

(** The worth of amounts, in 1/precision; of some states together. *)
Fixpoint worthR (ss : list spec) (z : nat -> Z) : R :=
  match ss with
  | [] => 0%R
  | s :: ss' =>
      (IZR precision * (IZR (s_weight s) / IZR weight_unit * return_value (s_return s) (IZR (z O) / IZR amount_unit))
       + worthR ss' (fun j => z (S j)))%R
  end.
(** * Soundness *)

Lemma root_up_ok n : 0 <= n -> 0 <= root_up n /\ (sqrt (IZR n) <= IZR (root_up n))%R.
Proof.
  intros Hn. assert (K : forall r, 0 <= r -> n <= r * r -> (sqrt (IZR n) <= IZR r)%R).
  { intros r Hr H. apply IZR_le in H. rewrite mult_IZR in H. apply IZR_nonneg in Hr.
    rewrite <- (sqrt_square (IZR r)) by exact Hr. apply sqrt_le_1_alt. exact H. }
  unfold root_up. cbv zeta. match goal with |- context [if ?b then _ else _] => destruct b eqn:E end.
  - split_andb. to_Z. split; [assumption | apply K; assumption].
  - split; [exact Hn | apply K; [exact Hn | nia]].
Qed.

Lemma root_down_ok n : 0 <= n -> 0 <= root_down n /\ (IZR (root_down n) <= sqrt (IZR n))%R.
Proof.
  intros Hn. unfold root_down. cbv zeta. match goal with |- context [if ?b then _ else _] => destruct b eqn:E end.
  - split_andb. to_Z. split; [assumption|].
    assert (HS : Z.sqrt n * Z.sqrt n <= n) by assumption. assert (Hr : 0 <= Z.sqrt n) by assumption.
    apply IZR_le in HS. rewrite mult_IZR in HS. apply IZR_nonneg in Hr.
    rewrite <- (sqrt_square (IZR (Z.sqrt n))) by exact Hr. apply sqrt_le_1_alt. exact HS.
  - split; [lia | apply sqrt_pos].
Qed.

Lemma coarse_root n : 0 <= n -> (sqrt (IZR n / IZR coarse) = sqrt (IZR (n * coarse)) / IZR coarse)%R.
Proof.
  intros Hn. apply IZR_nonneg in Hn. pose proof (IZR_pos _ coarse_pos) as P.
  rewrite mult_IZR.
  replace (IZR n * IZR coarse)%R with (IZR n / IZR coarse * (IZR coarse * IZR coarse))%R by (field; lra).
  rewrite sqrt_mult_alt.
  - rewrite sqrt_square by lra. field. lra.
  - apply Rmult_le_pos; [exact Hn | apply Rlt_le, Rinv_0_lt_compat, P].
Qed.

Lemma count_coarse n k : (Rmin (IZR n / IZR coarse) (IZR k) = IZR (Z.min n (k * coarse)) / IZR coarse)%R.
Proof.
  pose proof (IZR_pos _ coarse_pos) as P. unfold Rmin. destruct (Rle_dec (IZR n / IZR coarse) (IZR k)) as [L | L].
  - rewrite Z.min_l; [reflexivity|]. apply le_IZR. rewrite mult_IZR.
    apply (Rmult_le_compat_r (IZR coarse)) in L; [|lra]. unfold Rdiv in L. rewrite Rmult_assoc, Rinv_l in L by lra. lra.
  - rewrite Z.min_r.
    + rewrite mult_IZR. field. lra.
    + apply Rnot_le_lt in L.
      apply Z.lt_le_incl, lt_IZR. rewrite mult_IZR.
      apply (Rmult_lt_compat_r (IZR coarse)) in L; [|lra]. unfold Rdiv in L. rewrite Rmult_assoc, Rinv_l in L by lra. lra.
Qed.

Lemma return_up_ok r n : 0 <= n -> (return_value r (IZR n / IZR coarse) <= IZR (return_up r n) / IZR coarse)%R.
Proof.
  intros Hn. pose proof (IZR_pos _ coarse_pos) as P. destruct r as [|k]; simpl.
  - rewrite coarse_root by exact Hn. apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat, P|].
    apply root_up_ok. nia.
  - rewrite count_coarse. lra.
Qed.

Lemma return_down_ok r n : 0 <= n -> (IZR (return_down r n) / IZR coarse <= return_value r (IZR n / IZR coarse))%R.
Proof.
  intros Hn. pose proof (IZR_pos _ coarse_pos) as P. destruct r as [|k]; simpl.
  - rewrite coarse_root by exact Hn. apply Rmult_le_compat_r; [apply Rlt_le, Rinv_0_lt_compat, P|].
    apply root_down_ok. nia.
  - rewrite count_coarse. lra.
Qed.

Lemma coarse_up_ok c : 0 <= c -> (IZR c / IZR amount_unit <= IZR (coarse_up c) / IZR coarse)%R
  /\ (c <> 0 -> 0 < coarse_up c /\ (IZR (coarse_up c - 1) / IZR coarse <= IZR c / IZR amount_unit)%R)
  /\ 0 <= coarse_up c.
Proof.
  intros Hc. pose proof (IZR_pos _ coarse_pos) as P. pose proof (IZR_pos _ amount_unit_pos) as Pa.
  unfold coarse_up. destruct (Z.eqb_spec c 0) as [-> | Hne].
  - repeat split; try lia; try contradiction. unfold Rdiv. rewrite !Rmult_0_l. lra.
  - pose proof (cdiv_ge (c * coarse) amount_unit amount_unit_pos) as H1.
    assert (H2 : (cdiv (c * coarse) amount_unit - 1) * amount_unit < c * coarse).
    { unfold cdiv. pose proof (Z.mul_succ_div_gt (- (c * coarse)) amount_unit amount_unit_pos). nia. }
    set (u := cdiv (c * coarse) amount_unit) in *.
    assert (Hu : 0 < u) by nia.
    split; [|split; [intros _; split; [exact Hu|] | lia]].
    + apply Rmult_le_reg_r with (IZR coarse * IZR amount_unit)%R; [apply Rmult_lt_0_compat; assumption|].
      apply IZR_le in H1. rewrite !mult_IZR in H1.
      replace (IZR c / IZR amount_unit * (IZR coarse * IZR amount_unit))%R with (IZR c * IZR coarse)%R by (field; lra).
      replace (IZR u / IZR coarse * (IZR coarse * IZR amount_unit))%R with (IZR u * IZR amount_unit)%R by (field; lra).
      exact H1.
    + apply Rmult_le_reg_r with (IZR coarse * IZR amount_unit)%R; [apply Rmult_lt_0_compat; assumption|].
      apply Z.lt_le_incl, IZR_le in H2. rewrite !mult_IZR in H2.
      replace (IZR (u - 1) / IZR coarse * (IZR coarse * IZR amount_unit))%R with (IZR (u - 1) * IZR amount_unit)%R by (field; lra).
      replace (IZR c / IZR amount_unit * (IZR coarse * IZR amount_unit))%R with (IZR c * IZR coarse)%R by (field; lra).
      exact H2.
Qed.

Fixpoint seen_ok (ss : list spec) (seen : so_far_of) (z : nat -> Z) : Prop :=
  match ss, seen with
  | [], [] => True
  | s :: ss', (low, r) :: seen' =>
      0 <= low /\ (IZR low / IZR coarse <= IZR (z O) / IZR amount_unit)%R
      /\ (IZR r / IZR coarse <= return_value (s_return s) (IZR low / IZR coarse))%R
      /\ seen_ok ss' seen' (fun j => z (S j))
  | _, _ => False
  end.

Definition spec_ok (s : spec) : Prop := exists w r, s = spec_of w r /\ 0 <= w /\ is_return r.

Lemma nothing_ok ss : Forall spec_ok ss -> seen_ok ss (map (fun _ => (0, 0)) ss) (fun _ => 0).
Proof.
  pose proof (IZR_pos _ coarse_pos) as P. induction 1 as [|s ss [w [r [-> [Hw Hr]]]] H IH]; simpl; [exact Logic.I|].
  unfold Rdiv. rewrite !Rmult_0_l. repeat split; try lia; try lra; [|exact IH].
  apply return_nonneg; [exact Hr | lra].
Qed.

Lemma factor_ok w : 0 <= w ->
  (IZR precision * (IZR w / IZR weight_unit) <= IZR (s_factor (spec_of w Root)) * IZR coarse)%R.
Proof.
  intros Hw. simpl. pose proof (IZR_pos _ coarse_pos) as P. pose proof (IZR_pos _ weight_unit_pos) as Pw.
  pose proof (cdiv_R (precision * w) (weight_unit * coarse) ltac:(nia)) as H. rewrite !mult_IZR in H.
  apply (Rmult_le_compat_r (IZR coarse)) in H; [|lra].
  replace (IZR precision * IZR w / (IZR weight_unit * IZR coarse) * IZR coarse)%R
    with (IZR precision * (IZR w / IZR weight_unit))%R in H by (field; lra). exact H.
Qed.

Lemma worth_ext ss : forall z z', (forall j, z j = z' j) -> worthR ss z = worthR ss z'.
Proof. induction ss as [|s ss IH]; intros z z' H; simpl; [reflexivity|]. rewrite H, (IH _ (fun j => z' (S j))); auto. Qed.

(** A gain is no more than the coarse one. *)
Lemma gain_ok ss : Forall spec_ok ss -> forall seen z cs,
  seen_ok ss seen z -> (forall j, 0 <= z j) -> Forall (fun x => 0 <= x) cs -> length cs = length ss ->
  (worthR ss (fun j => z j + nth j cs 0)%Z - worthR ss z <= IZR (gain ss seen (map coarse_up cs)))%R
  /\ seen_ok ss (see ss seen (map coarse_up cs)) (fun j => z j + nth j cs 0)%Z.
Proof.
  pose proof (IZR_pos _ coarse_pos) as P. pose proof (IZR_pos _ amount_unit_pos) as Pa.
  pose proof (IZR_pos _ precision_pos) as Pp.
  induction 1 as [|s ss [w [r [-> [Hw Hr]]]] Hss IH]; intros seen z cs Hs Hz Hcs Hlen.
  - destruct seen; [|contradiction]. simpl. split; [lra | exact Logic.I].
  - destruct seen as [|[low lr] seen]; [contradiction|]. destruct cs as [|c cs]; [discriminate|].
    destruct Hs as [Hlow [Hlz [Hlr Hs]]]. apply Forall_cons_iff in Hcs. destruct Hcs as [Hc Hcs].
    injection Hlen as Hlen.
    destruct (IH seen (fun j => z (S j)) cs Hs (fun j => Hz (S j)) Hcs Hlen) as [IHg IHs].
    destruct (coarse_up_ok c Hc) as [Hup [Hdown Hu0]].
    cbn [map gain see worthR nth].
    set (RV := return_value r) in *. simpl s_return in *. fold RV in Hlr |- *.
    set (W := (IZR precision * (IZR w / IZR weight_unit))%R).
    assert (HW : (0 <= W)%R).
    { unfold W. apply Rmult_le_pos; [lra | apply frac_nonneg; assumption]. }
    destruct (Z.eqb_spec c 0) as [-> | Hne].
    + change (coarse_up 0) with 0. simpl (0 =? 0). cbv iota. rewrite Z.add_0_r. split; [lra|].
      cbn [seen_ok]. rewrite Z.add_0_r. repeat split; assumption.
    + destruct (Hdown Hne) as [Hpos Hbelow].
      destruct (Z.eqb_spec (coarse_up c) 0) as [E0 | _]; [lia|].
      set (u := coarse_up c) in *.
      assert (Hzr : (0 <= IZR (z O) / IZR amount_unit)%R) by (apply frac_nonneg; [apply Hz | assumption]).
      assert (Hcr : (0 <= IZR c / IZR amount_unit)%R) by (apply frac_nonneg; assumption).
      assert (Hl0 : (0 <= IZR low / IZR coarse)%R) by (apply frac_nonneg; assumption).
      assert (Esum : (IZR (z O + c) / IZR amount_unit = IZR (z O) / IZR amount_unit + IZR c / IZR amount_unit)%R).
      { rewrite plus_IZR. field. lra. }
      split.
      * rewrite Esum, plus_IZR, mult_IZR, minus_IZR.
        pose proof (return_shrinks r (IZR low / IZR coarse) (IZR (z O) / IZR amount_unit - IZR low / IZR coarse)
                      (IZR c / IZR amount_unit) Hl0 ltac:(lra) Hcr) as D.
        replace (IZR low / IZR coarse + (IZR (z O) / IZR amount_unit - IZR low / IZR coarse))%R
          with (IZR (z O) / IZR amount_unit)%R in D by ring.
        pose proof (return_monotone r (IZR low / IZR coarse + IZR c / IZR amount_unit) (IZR (low + u) / IZR coarse)) as Mo.
        assert (Elow : (IZR (low + u) / IZR coarse = IZR low / IZR coarse + IZR u / IZR coarse)%R).
        { rewrite plus_IZR. field. lra. }
        rewrite Elow in Mo. specialize (Mo ltac:(lra)). rewrite <- Elow in Mo.
        pose proof (return_up_ok r (low + u) ltac:(lia)) as Up. fold RV in D, Mo, Up.
        set (g := (IZR (return_up r (low + u)) - IZR lr)%R).
        assert (Hg : (RV (IZR (z O) / IZR amount_unit + IZR c / IZR amount_unit) - RV (IZR (z O) / IZR amount_unit) <= g / IZR coarse)%R).
        { replace (g / IZR coarse)%R with (IZR (return_up r (low + u)) / IZR coarse - IZR lr / IZR coarse)%R
            by (unfold g; field; lra). lra. }
        assert (Hg0 : (0 <= g / IZR coarse)%R).
        { eapply Rle_trans; [|exact Hg].
          pose proof (return_monotone r (IZR (z O) / IZR amount_unit) (IZR (z O) / IZR amount_unit + IZR c / IZR amount_unit) ltac:(lra)) as M2.
          fold RV in M2. lra. }
        pose proof (factor_ok w Hw) as Hf. fold W in Hf. simpl s_factor in *.
        set (f := IZR (cdiv (precision * w) (weight_unit * coarse))) in *.
        assert (Hgc : (W * (g / IZR coarse) <= f * g)%R).
        { apply (Rmult_le_compat_r (g / IZR coarse)) in Hf; [|exact Hg0].
          replace (f * IZR coarse * (g / IZR coarse))%R with (f * g)%R in Hf by (field; lra). exact Hf. }
        apply (Rmult_le_compat_l W) in Hg; [|exact HW].
        change (s_weight (spec_of w r)) with w. rewrite <- !(Rmult_assoc (IZR precision)). fold W. lra.
      * cbn [seen_ok]. repeat split.
        -- lia.
        -- rewrite Esum. replace (low + u - 1) with (low + (u - 1)) by lia. rewrite plus_IZR.
           replace ((IZR low + IZR (u - 1)) / IZR coarse)%R with (IZR low / IZR coarse + IZR (u - 1) / IZR coarse)%R by (field; lra).
           lra.
        -- apply return_down_ok. lia.
        -- exact IHs.
Qed.

(** Gains of some states, one after the other, are no more than those of each alone. *)
Lemma worth_shrinks ss : Forall spec_ok ss -> forall z e c,
  (forall j, 0 <= z j) -> (forall j, 0 <= e j) -> (forall j, 0 <= c j) ->
  (worthR ss (fun j => z j + e j + c j)%Z - worthR ss (fun j => z j + e j)%Z
   <= worthR ss (fun j => z j + c j)%Z - worthR ss z)%R.
Proof.
  induction 1 as [|s ss [w [r [-> [Hw Hr]]]] Hss IH]; intros z e c Hz He Hc; simpl; [lra|].
  specialize (IH _ _ _ (fun j => Hz (S j)) (fun j => He (S j)) (fun j => Hc (S j))). cbv beta in IH.
  assert (HW : (0 <= IZR precision * (IZR w / IZR weight_unit))%R).
  { apply Rmult_le_pos; [apply IZR_nonneg; lia | apply frac_nonneg; assumption]. }
  pose proof (return_shrinks r (IZR (z O) / IZR amount_unit) (IZR (e O) / IZR amount_unit) (IZR (c O) / IZR amount_unit)
    (frac_nonneg _ _ (Hz O) amount_unit_pos) (frac_nonneg _ _ (He O) amount_unit_pos)
    (frac_nonneg _ _ (Hc O) amount_unit_pos)) as D.
  pose proof (IZR_pos _ amount_unit_pos) as Pa.
  rewrite !plus_IZR.
  replace ((IZR (z 0%nat) + IZR (e 0%nat) + IZR (c 0%nat)) / IZR amount_unit)%R
    with (IZR (z O) / IZR amount_unit + IZR (e O) / IZR amount_unit + IZR (c O) / IZR amount_unit)%R by (field; lra).
  replace ((IZR (z 0%nat) + IZR (e 0%nat)) / IZR amount_unit)%R
    with (IZR (z O) / IZR amount_unit + IZR (e O) / IZR amount_unit)%R by (field; lra).
  replace ((IZR (z 0%nat) + IZR (c 0%nat)) / IZR amount_unit)%R
    with (IZR (z O) / IZR amount_unit + IZR (c O) / IZR amount_unit)%R by (field; lra).
  apply (Rmult_le_compat_l _ _ _ HW) in D. rewrite <- !(Rmult_assoc (IZR precision)). lra.
Qed.

Lemma nth_nonneg cs j : Forall (fun x => 0 <= x) cs -> 0 <= nth j cs 0.
Proof.
  intros H. destruct (nth_in_or_default j cs 0) as [Hin | ->]; [|lia].
  rewrite Forall_forall in H. apply H, Hin.
Qed.
End Gains.
