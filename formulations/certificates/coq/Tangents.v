(** What drones gain together, relaxed to a sum over them.

    Of a group that is seen already, f (z + y) - f z is what an amount of y gains. It is no more than
    what the drones' shares of y gain one by one. Nor is it more than a tangent of f says, which is
    straight in y. Any mixture of the two holds, too, and is a constant and a number for each drone.
    docs/concepts/step-envelopes.md says what that is good for. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz.
From CocapCheck Require Import Spec Sums Returns Gains.
Import ListNotations.
Open Scope Z_scope.

(** Shares are in 1/whole. *)
Definition whole : Z := 1073741824.

(** Of a group: the share of what drones gain one by one; the coarse root at which the tangent
    touches, where the return is one.  Nothing is asked of these numbers. *)
Definition touch : Type := Z * Z.

(** What they make of a group: whole times what is gained is at most [alone] times what drones gain
    one by one, and [slope] times the amount, and [beyond]. *)
Record line := Line { alone : Z; slope : Z; beyond : Z }.
Definition one_by_one : line := Line whole 0 0.

Section Tangents.
Variables (amount_unit weight_unit precision coarse : Z).
Hypothesis amount_unit_pos : 0 < amount_unit.
Hypothesis weight_unit_pos : 0 < weight_unit.
Hypothesis precision_pos : 0 < precision.
Hypothesis coarse_pos : 0 < coarse.

(** z and r: what is seen of the group, and its return. *)
Definition line_of (f : return_of) (z r : Z) (by_ : touch) : line :=
  let (share, root) := by_ in
  let rest := whole - share in
  if (0 <=? share) && (0 <=? rest) then
    match f with
    | AtMost k => Line share 0 (rest * Z.max 0 (k * coarse - r))
    | Root =>
        if 0 <? root then Line share (cdiv (rest * coarse) (2 * root))
                               (cdiv (rest * (z * coarse + root * root - 2 * root * r)) (2 * root))
        else one_by_one
    end
  else one_by_one.

(** Groups without numbers: what drones gain one by one. *)
Fixpoint lines_of (ss : list spec) (seen : so_far_of) (by_ : list touch) : list line :=
  match ss, seen with
  | s :: ss', (z, r) :: seen' =>
      match by_ with
      | [] => one_by_one :: lines_of ss' seen' []
      | b :: by' => line_of (s_return s) z r b :: lines_of ss' seen' by'
      end
  | _, _ => []
  end.

Fixpoint relaxed_constant (ss : list spec) (ls : list line) : Z :=
  match ss, ls with
  | s :: ss', l :: ls' => s_factor s * cdiv (beyond l) whole + relaxed_constant ss' ls'
  | _, _ => 0
  end.

(** Of a coarse amount of a group, in the units of coarse returns. *)
Definition relaxed_share (f : return_of) (z r : Z) (l : line) (c : Z) : Z :=
  cdiv ((if alone l =? 0 then 0 else alone l * (return_up coarse f (z + c) - r)) + slope l * c) whole.

Lemma relaxed_share_eq f z r l c :
  relaxed_share f z r l c = cdiv (alone l * (return_up coarse f (z + c) - r) + slope l * c) whole.
Proof. unfold relaxed_share. destruct (Z.eqb_spec (alone l) 0) as [-> | _]; reflexivity. Qed.

Fixpoint relaxed_gain (ss : list spec) (seen : so_far_of) (ls : list line) (cs : list Z) : Z :=
  match ss, seen, ls, cs with
  | s :: ss', (z, r) :: seen', l :: ls', c :: cs' =>
      if c =? 0 then relaxed_gain ss' seen' ls' cs'
      else s_factor s * relaxed_share (s_return s) z r l c + relaxed_gain ss' seen' ls' cs'
  | _, _, _, _ => 0
  end.

(** * Soundness *)

Notation coarse_up := (coarse_up amount_unit coarse).
Notation return_up := (return_up coarse).

(** What some coarse amounts of a group gain one by one, and together at most. *)
Definition singly (f : return_of) (z r : Z) (us : list Z) : Z :=
  sumZ (map (fun u => if u =? 0 then 0 else return_up f (z + u) - r) us).

Definition gained (f : return_of) (z : Z) (y : Z) : R :=
  (IZR coarse * (return_value f (IZR (z + y) / IZR coarse) - return_value f (IZR z / IZR coarse)))%R.

Lemma singly_ok f z r us : 0 <= z -> (IZR r / IZR coarse <= return_value f (IZR z / IZR coarse))%R ->
  Forall (fun u => 0 <= u) us -> (gained f z (sumZ us) <= IZR (singly f z r us))%R.
Proof.
  intros Hz Hr. pose proof (IZR_pos _ coarse_pos) as P. unfold gained.
  assert (Hr' : (IZR r <= IZR coarse * return_value f (IZR z / IZR coarse))%R).
  { apply (Rmult_le_compat_l (IZR coarse)) in Hr; [|lra].
    replace (IZR coarse * (IZR r / IZR coarse))%R with (IZR r) in Hr by (field; lra). exact Hr. }
  induction 1 as [|u us Hu Hus IH]; [unfold singly; simpl; rewrite Z.add_0_r; lra|].
  assert (H0 : 0 <= sumZ us) by (clear - Hus; induction Hus; simpl; lia).
  unfold singly in *. cbn [map sumZ].
  assert (Hdiv : forall a b, (IZR (a + b) / IZR coarse = IZR a / IZR coarse + IZR b / IZR coarse)%R).
  { intros. rewrite plus_IZR. field. lra. }
  pose proof (return_shrinks f (IZR z / IZR coarse) (IZR (sumZ us) / IZR coarse) (IZR u / IZR coarse)
    (frac_nonneg _ _ Hz coarse_pos) (frac_nonneg _ _ H0 coarse_pos) (frac_nonneg _ _ Hu coarse_pos)) as D.
  replace (z + (u + sumZ us)) with (z + sumZ us + u) by lia. rewrite Hdiv in IH. rewrite !Hdiv, plus_IZR.
  destruct (Z.eqb_spec u 0) as [-> | Hne].
  - replace (IZR 0 / IZR coarse)%R with 0%R by (field; lra). rewrite Rplus_0_r. lra.
  - pose proof (return_up_ok coarse coarse_pos f (z + u) ltac:(lia)) as Up. rewrite Hdiv in Up.
    apply (Rmult_le_compat_l (IZR coarse)) in Up; [|lra].
    replace (IZR coarse * (IZR (return_up f (z + u)) / IZR coarse))%R with (IZR (return_up f (z + u))) in Up by (field; lra).
    apply (Rmult_le_compat_l (IZR coarse)) in D; [|lra]. rewrite minus_IZR. lra.
Qed.

(** sqrt x <= (x / m + m) / 2 for any m > 0. *)
Lemma tangent_of_root x m : (0 <= x)%R -> (0 < m)%R -> (sqrt x * (2 * m) <= x + m * m)%R.
Proof.
  intros Hx Hm. pose proof (sqrt_sqrt x Hx) as S. pose proof (Rle_0_sqr (sqrt x - m)) as Q. unfold Rsqr in Q. nra.
Qed.

Lemma line_ok f z r b y most : is_return f -> 0 <= z -> 0 <= y ->
  (IZR r / IZR coarse <= return_value f (IZR z / IZR coarse))%R -> (gained f z y <= most)%R ->
  let l := line_of f z r b in
  0 <= slope l /\ (IZR whole * gained f z y <= IZR (alone l) * most + IZR (slope l * y + beyond l))%R.
Proof.
  intros Hf Hz Hy Hr Hmost. pose proof (IZR_pos _ coarse_pos) as P.
  assert (Eone : 0 <= slope one_by_one /\ (IZR whole * gained f z y <= IZR (alone one_by_one) * most + IZR (slope one_by_one * y + beyond one_by_one))%R).
  { cbn [one_by_one alone slope beyond]. split; [lia|]. rewrite Z.mul_0_l. simpl (0 + 0).
    assert (0 < IZR whole)%R by (apply IZR_lt; reflexivity). nra. }
  assert (Hdiv : (IZR coarse * (IZR r / IZR coarse) = IZR r)%R) by (field; lra).
  assert (Hr' : (IZR r <= IZR coarse * return_value f (IZR z / IZR coarse))%R).
  { apply (Rmult_le_compat_l (IZR coarse)) in Hr; [|lra]. lra. }
  destruct b as [share root]. cbv zeta. unfold line_of.
  destruct (Z.leb_spec 0 share) as [Hs | _]; [|exact Eone].
  destruct (Z.leb_spec 0 (whole - share)) as [Hrest | _]; [|exact Eone]. cbn [andb].
  assert (Esplit : (IZR whole * gained f z y = IZR share * gained f z y + IZR (whole - share) * gained f z y)%R)
    by (rewrite minus_IZR; ring).
  assert (Hshare : (IZR share * gained f z y <= IZR share * most)%R)
    by (apply Rmult_le_compat_l; [apply IZR_nonneg; exact Hs | exact Hmost]).
  apply IZR_nonneg in Hrest as HrestR.
  destruct f as [|k].
  - destruct (Z.ltb_spec 0 root) as [Hroot | _]; [|exact Eone]. cbn [alone slope beyond].
    set (rest := whole - share) in *.
    pose proof (cdiv_ge (rest * coarse) (2 * root) ltac:(lia)) as H1.
    pose proof (cdiv_ge (rest * (z * coarse + root * root - 2 * root * r)) (2 * root) ltac:(lia)) as H2.
    set (b := cdiv (rest * coarse) (2 * root)) in *.
    set (k := cdiv (rest * (z * coarse + root * root - 2 * root * r)) (2 * root)) in *.
    split; [nia|].
    assert (Hk : rest * ((z + y) * coarse + root * root - 2 * root * r) <= (b * y + k) * (2 * root)) by nia.
    rewrite Esplit. enough (IZR rest * gained Root z y <= IZR (b * y + k))%R by lra.
    apply IZR_le in Hk. rewrite !mult_IZR in Hk. apply IZR_pos in Hroot as HrootR.
    apply Rmult_le_reg_r with (2 * IZR root)%R; [lra|]. eapply Rle_trans; [|exact Hk].
    rewrite Rmult_assoc. apply Rmult_le_compat_l; [exact HrestR|].
    rewrite ?minus_IZR, ?plus_IZR, ?mult_IZR.
    assert (Hroot_of : (IZR coarse * sqrt (IZR (z + y) / IZR coarse) = sqrt (IZR ((z + y) * coarse)))%R).
    { rewrite (coarse_root coarse coarse_pos) by lia. field. lra. }
    assert (Hx : (0 <= IZR ((z + y) * coarse))%R) by (apply IZR_nonneg; nia).
    pose proof (tangent_of_root _ _ Hx HrootR) as Ht. rewrite <- Hroot_of in Ht. rewrite mult_IZR, plus_IZR in Ht.
    unfold gained, return_value in *. rewrite plus_IZR in *.
    assert (IZR r * (2 * IZR root) <= IZR coarse * sqrt (IZR z / IZR coarse) * (2 * IZR root))%R
      by (apply Rmult_le_compat_r; lra).
    lra.
  - cbn [alone slope beyond]. split; [lia|]. rewrite Z.mul_0_l, Z.add_0_l, Esplit, mult_IZR.
    enough (gained (AtMost k) z y <= IZR (Z.max 0 (k * coarse - r)))%R.
    { apply (Rmult_le_compat_l (IZR (whole - share))) in H; [|exact HrestR]. lra. }
    apply Rle_trans with (IZR (k * coarse - r)); [|apply IZR_le; lia].
    unfold gained, return_value in *. rewrite minus_IZR, mult_IZR.
    pose proof (Rmin_r (IZR (z + y) / IZR coarse) (IZR k)) as Hm.
    apply (Rmult_le_compat_l (IZR coarse)) in Hm; lra.
Qed.

(** What amounts of one group gain, in 1/precision. *)
Lemma group_relaxed w f z low r b cs : 0 <= w -> is_return f -> 0 <= z -> 0 <= low ->
  (IZR low / IZR coarse <= IZR z / IZR amount_unit)%R ->
  (IZR r / IZR coarse <= return_value f (IZR low / IZR coarse))%R -> Forall (fun c => 0 <= c) cs ->
  let l := line_of f low r b in
  (IZR precision * (IZR w / IZR weight_unit)
     * (return_value f (IZR (z + sumZ cs) / IZR amount_unit) - return_value f (IZR z / IZR amount_unit))
   <= IZR (s_factor (spec_of weight_unit precision coarse w f)
           * (cdiv (beyond l) whole
              + sumZ (map (fun u => if u =? 0 then 0 else cdiv (alone l * (return_up f (low + u) - r) + slope l * u) whole)
                          (map coarse_up cs)))%Z))%R.
Proof.
  intros Hw Hf Hz Hlow Hlz Hr Hcs l. pose proof (IZR_pos _ coarse_pos) as P. pose proof (IZR_pos _ amount_unit_pos) as Pa.
  set (us := map coarse_up cs).
  assert (Hus : Forall (fun u => 0 <= u) us).
  { unfold us. clear - Hcs amount_unit_pos coarse_pos. induction Hcs as [|c cs Hc H IH]; simpl; constructor; [|exact IH].
    apply (coarse_up_ok amount_unit coarse amount_unit_pos coarse_pos c Hc). }
  assert (Hy : 0 <= sumZ us) by (clear - Hus; induction Hus; simpl; lia).
  assert (Hc0 : 0 <= sumZ cs) by (clear - Hcs; induction Hcs; simpl; lia).
  assert (Hsum : (IZR (sumZ cs) / IZR amount_unit <= IZR (sumZ us) / IZR coarse)%R).
  { unfold us. clear - Hcs amount_unit_pos coarse_pos. induction Hcs as [|c cs Hc H IH]; simpl; [unfold Rdiv; lra|].
    destruct (coarse_up_ok amount_unit coarse amount_unit_pos coarse_pos c Hc) as [Hup _].
    rewrite !plus_IZR. unfold Rdiv in *. rewrite !Rmult_plus_distr_r. lra. }
  assert (Hdiv : forall a b u, (IZR (a + b) / IZR u = IZR a / IZR u + IZR b / IZR u)%R).
  { intros. rewrite plus_IZR. unfold Rdiv. ring. }
  (* what is seen is at least low, so that less is gained *)
  assert (Hgain : (return_value f (IZR (z + sumZ cs) / IZR amount_unit) - return_value f (IZR z / IZR amount_unit)
      <= gained f low (sumZ us) / IZR coarse)%R).
  { pose proof (frac_nonneg _ _ Hlow coarse_pos) as Hl0. pose proof (frac_nonneg _ _ Hc0 amount_unit_pos) as Hc1.
    pose proof (return_shrinks f (IZR low / IZR coarse) (IZR z / IZR amount_unit - IZR low / IZR coarse)
      (IZR (sumZ cs) / IZR amount_unit) Hl0 ltac:(lra) Hc1) as D.
    replace (IZR low / IZR coarse + (IZR z / IZR amount_unit - IZR low / IZR coarse))%R with (IZR z / IZR amount_unit)%R in D by ring.
    pose proof (return_monotone f (IZR low / IZR coarse + IZR (sumZ cs) / IZR amount_unit)
      (IZR low / IZR coarse + IZR (sumZ us) / IZR coarse) ltac:(lra)) as Mo.
    unfold gained. rewrite !Hdiv.
    replace (IZR coarse * (return_value f (IZR low / IZR coarse + IZR (sumZ us) / IZR coarse) - return_value f (IZR low / IZR coarse)) / IZR coarse)%R
      with (return_value f (IZR low / IZR coarse + IZR (sumZ us) / IZR coarse) - return_value f (IZR low / IZR coarse))%R by (field; lra).
    lra. }
  assert (Hg0 : (0 <= gained f low (sumZ us))%R).
  { unfold gained. apply Rmult_le_pos; [lra|]. rewrite Hdiv.
    pose proof (return_monotone f (IZR low / IZR coarse) (IZR low / IZR coarse + IZR (sumZ us) / IZR coarse)) as Mo.
    pose proof (frac_nonneg _ _ Hlow coarse_pos). pose proof (frac_nonneg _ _ Hy coarse_pos). lra. }
  pose proof (singly_ok f low r us Hlow Hr Hus) as Hsingly.
  destruct (line_ok f low r b (sumZ us) _ Hf Hlow Hy Hr Hsingly) as [Hslope Hline]. fold l in Hslope, Hline.
  set (share := fun u => if u =? 0 then 0 else cdiv (alone l * (return_up f (low + u) - r) + slope l * u) whole).
  assert (Hwhole : 0 < whole) by reflexivity.
  assert (Hshares : alone l * singly f low r us + slope l * sumZ us <= sumZ (map share us) * whole).
  { unfold singly. clearbody us. clear - Hwhole. induction us as [|u us IH]; [simpl; lia|]. cbn [map sumZ].
    unfold share at 1. destruct (Z.eqb_spec u 0) as [-> | Hne].
    - rewrite !Z.add_0_l. exact IH.
    - pose proof (cdiv_ge (alone l * (return_up f (low + u) - r) + slope l * u) whole Hwhole). lia. }
  pose proof (cdiv_ge (beyond l) whole Hwhole) as Hbeyond.
  assert (Hall : (gained f low (sumZ us) <= IZR (cdiv (beyond l) whole + sumZ (map share us)))%R).
  { apply Rmult_le_reg_r with (IZR whole); [apply IZR_lt; exact Hwhole|].
    rewrite Rmult_comm. eapply Rle_trans; [exact Hline|]. rewrite <- !mult_IZR, <- plus_IZR. apply IZR_le. lia. }
  (* the weight *)
  rewrite mult_IZR.
  pose proof (factor_ok weight_unit precision coarse weight_unit_pos coarse_pos w Hw) as Hfac.
  change (s_factor (spec_of weight_unit precision coarse w Root)) with (s_factor (spec_of weight_unit precision coarse w f)) in Hfac.
  set (W := (IZR precision * (IZR w / IZR weight_unit))%R) in *.
  assert (HW : (0 <= W)%R) by (unfold W; apply Rmult_le_pos; [apply IZR_nonneg; lia | apply frac_nonneg; assumption]).
  set (fac := IZR (s_factor (spec_of weight_unit precision coarse w f))) in *.
  assert (Hfac0 : (0 <= fac)%R).
  { destruct (Rle_dec 0 fac) as [L | G]; [exact L|]. exfalso. apply Rnot_le_lt in G.
    assert (fac * IZR coarse < 0)%R by nra. lra. }
  apply Rle_trans with (W * (gained f low (sumZ us) / IZR coarse))%R; [apply Rmult_le_compat_l; assumption|].
  apply Rle_trans with (fac * gained f low (sumZ us))%R; [|apply Rmult_le_compat_l; assumption].
  apply (Rmult_le_compat_r (gained f low (sumZ us) / IZR coarse)) in Hfac.
  - replace (fac * IZR coarse * (gained f low (sumZ us) / IZR coarse))%R with (fac * gained f low (sumZ us))%R in Hfac by (field; lra).
    exact Hfac.
  - unfold Rdiv. apply Rmult_le_pos; [exact Hg0 | apply Rlt_le, Rinv_0_lt_compat, P].
Qed.

(** What drones gain together is no more than the constant and the numbers of each. *)
Theorem relaxed_ok ss : Forall (spec_ok weight_unit precision coarse) ss -> forall seen by_ z (ls : list (list Z)),
  seen_ok amount_unit coarse ss seen z -> (forall j, 0 <= z j) ->
  (forall cs, In cs ls -> length cs = length ss /\ Forall (fun x => 0 <= x) cs) ->
  (worthR amount_unit weight_unit precision ss (fun j => z j + sumZ (map (fun cs => nth j cs 0) ls))%Z
     - worthR amount_unit weight_unit precision ss z
   <= IZR (relaxed_constant ss (lines_of ss seen by_)
           + sumZ (map (fun cs => relaxed_gain ss seen (lines_of ss seen by_) (map coarse_up cs)) ls))%Z)%R.
Proof.
  induction 1 as [|s ss [w [f [-> [Hw Hf]]]] Hss IH]; intros seen by_ z ls Hs Hz Hls.
  - simpl. rewrite sumZ_zero; [simpl; lra|]. intros cs _. reflexivity.
  - destruct seen as [|[low r] seen]; [contradiction|]. destruct Hs as [Hlow [Hlz [Hr Hs]]]. simpl s_return in *.
    set (b := match by_ with [] => (-1, 0) | b :: _ => b end). set (bs := match by_ with [] => [] | _ :: bs => bs end).
    assert (El : lines_of (spec_of weight_unit precision coarse w f :: ss) ((low, r) :: seen) by_
                 = line_of f low r b :: lines_of ss seen bs) by (unfold b, bs; destruct by_; reflexivity).
    rewrite El. clear El. clearbody b bs.
    specialize (IH seen bs (fun j => z (S j)) (map (fun cs => tl cs) ls) Hs (fun j => Hz (S j))).
    assert (Hls' : forall cs, In cs (map (fun cs => tl cs) ls) -> length cs = length ss /\ Forall (fun x => 0 <= x) cs).
    { intros cs Hcs. apply in_map_iff in Hcs. destruct Hcs as [cs' [<- Hin]]. destruct (Hls cs' Hin) as [Hlen Hpos].
      destruct cs' as [|c cs']; [discriminate|]. simpl in *. inversion Hpos; subst. split; [lia | assumption]. }
    specialize (IH Hls').
    assert (Hheads : Forall (fun c => 0 <= c) (map (fun cs => hd 0 cs) ls)).
    { apply Forall_forall. intros c Hc. apply in_map_iff in Hc. destruct Hc as [cs [<- Hin]]. destruct (Hls cs Hin) as [_ Hpos].
      destruct Hpos; simpl; lia. }
    pose proof (group_relaxed w f (z O) low r b _ Hw Hf (Hz O) Hlow Hlz Hr Hheads) as HG. cbv zeta in HG.
    set (l := line_of f low r b) in *. set (sp := spec_of weight_unit precision coarse w f) in *.
    cbn [worthR relaxed_constant].
    assert (Ehd : sumZ (map (fun cs => nth 0 cs 0) ls) = sumZ (map (fun cs => hd 0 cs) ls)).
    { apply sumZ_ext. intros cs _. destruct cs; reflexivity. }
    rewrite Ehd.
    rewrite (worth_ext amount_unit weight_unit precision ss (fun j => z (S j) + sumZ (map (fun cs => nth (S j) cs 0) ls))%Z
       (fun j => z (S j) + sumZ (map (fun cs => nth j cs 0) (map (fun cs => tl cs) ls)))%Z).
    2:{ intros j. f_equal. rewrite map_map. apply sumZ_ext. intros cs _. destruct cs; [destruct j|]; reflexivity. }
    assert (Egain : sumZ (map (fun cs => relaxed_gain (sp :: ss) ((low, r) :: seen) (l :: lines_of ss seen bs) (map coarse_up cs)) ls)
      = s_factor sp * sumZ (map (fun u => if u =? 0 then 0 else cdiv (alone l * (return_up f (low + u) - r) + slope l * u) whole)
                              (map coarse_up (map (fun cs => hd 0 cs) ls)))
        + sumZ (map (fun cs => relaxed_gain ss seen (lines_of ss seen bs) (map coarse_up cs)) (map (fun cs => tl cs) ls))).
    { rewrite !map_map, <- sumZ_scale, <- sumZ_add. apply sumZ_ext. intros cs Hin.
      destruct (Hls cs Hin) as [Hlen _]. destruct cs as [|c cs]; [discriminate|]. cbn [map hd tl relaxed_gain].
      change (s_return sp) with f. rewrite relaxed_share_eq. destruct (coarse_up c =? 0); lia. }
    rewrite Egain. rewrite ?plus_IZR, ?mult_IZR in *. rewrite ?plus_IZR in *. unfold sp in HG at 1 |- *.
    change (s_weight (spec_of weight_unit precision coarse w f)) with w.
    change (s_return (spec_of weight_unit precision coarse w f)) with f. fold sp in HG |- *. lra.
Qed.
End Tangents.
