(** A search through joint states, drone by drone, that leaves out none that counts.

    Gains only shrink as more is seen, so that what the drones left would each gain now bounds what
    they gain together. Numbers that bound are coarse and rounded up; a joint state that is complete
    is handed on. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation.
From CocapCheck Require Import Spec Sums Returns Sweep.
Import ListNotations.
Open Scope Z_scope.

Section Search.
Variable who : Type.                       (* a drone's class, places and whatever matters *)
Variable conflict : who -> who -> bool.
Hypothesis conflict_symmetric : forall a b, conflict a b = conflict b a.
Variables (amount_unit weight_unit precision coarse : Z).
Hypothesis amount_unit_pos : 0 < amount_unit.
Hypothesis weight_unit_pos : 0 < weight_unit.
Hypothesis precision_pos : 0 < precision.
Hypothesis coarse_pos : 0 < coarse.

(** A state that a drone may take, with its amounts of each group. *)
Record cand := Cand {
  name : who;
  amounts : list Z;        (* in 1/amount_unit *)
  amounts_up : list Z;     (* in 1/coarse, rounded up *)
  price : Z;               (* both in 1/precision *)
  charge : Z;
  static : list Z          (* what it adds to each static bound *)
}.

(** A group: its weight, the same as a factor of coarse returns, rounded up, and its return. *)
Record spec := Spec { s_weight : Z; s_factor : Z; s_return : return_of }.
Variable specs : list spec.

Definition spec_of (w : Z) (r : return_of) : spec := Spec w (cdiv (precision * w) (weight_unit * coarse)) r.
Hypothesis specs_ok : forall s, In s specs ->
  exists w r, s = spec_of w r /\ 0 <= w /\ is_return r.

Definition coarse_up (c : Z) : Z := if c =? 0 then 0 else cdiv (c * coarse) amount_unit.
Definition cand_ok (c : cand) : Prop :=
  length (amounts c) = length specs /\ Forall (fun x => 0 <= x) (amounts c) /\ amounts_up c = map coarse_up (amounts c).

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

Definition nothing : so_far_of := map (fun _ => (0, 0)) specs.

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

Definition together (l : list cand) (j : nat) : Z := sumZ (map (fun c => nth j (amounts c) 0) l).
Definition F (l : list cand) : R := worthR specs (together l).
Definition sum (f : cand -> Z) (l : list cand) : Z := sumZ (map f l).
Definition profitR (l : list cand) : R := (F l - IZR (sum price l))%R.

(** * Pools: how many drones of a class are left, and the states that they may take *)

Definition pool (A : Type) : Type := list (nat * list A).

Definition most_of {A} (f : A -> Z) (l : list A) : option Z := largest (fun a => Some (f a)) l None.

Fixpoint mosts {A} (f : A -> Z) (p : pool A) : option (list Z) :=
  match p with
  | [] => Some []
  | (_, l) :: rest => match most_of f l, mosts f rest with
                      | Some m, Some ms => Some (m :: ms)
                      | _, _ => None
                      end
  end.

Fixpoint most_together {A} (p : pool A) (ms : list Z) : Z :=
  match p, ms with
  | (n, _) :: rest, m :: ms' => Z.of_nat n * m + most_together rest ms'
  | _, _ => 0
  end.

Fixpoint keep_each {A} (f : A -> Z) (room : Z) (p : pool A) (ms : list Z) : pool A :=
  match p, ms with
  | (n, l) :: rest, m :: ms' => let least := m - room in
      (n, filter (fun a => least <? f a) l) :: keep_each f room rest ms'
  | _, _ => []
  end.

(** Drops what is in no completion whose sum of f, and the base, is above a threshold. *)
Definition keep {A} (threshold base : Z) (f : A -> Z) (p : pool A) : option (pool A) :=
  match mosts f p with
  | None => None
  | Some ms => let room := base + most_together p ms - threshold in
      if room <=? 0 then None else Some (keep_each f room p ms)
  end.

(** A static bound: of profits, or a limit that is not to be below 0. *)
Definition base : Type := bool * Z.

Fixpoint keep_static (best : Z) (j : nat) (bases : list base) (p : pool cand) : option (pool cand) :=
  match bases with
  | [] => Some p
  | (is_limit, b) :: rest =>
      match keep (if is_limit : bool then -1 else best) b (fun c => nth j (static c) 0) p with
      | None => None
      | Some p' => keep_static best (S j) rest p'
      end
  end.

Fixpoint add_static (bases : list base) (vs : list Z) : list base :=
  match bases, vs with
  | (l, b) :: rest, v :: vs' => (l, b + v) :: add_static rest vs'
  | (l, b) :: rest, [] => (l, b) :: rest
  | [], _ => []
  end.

(** * The search *)

Variable A : Type.                              (* what it brings back *)
Variable threshold : A -> Z.                    (* joint states of no more profit do not matter *)
Variable take_down : list cand -> A -> A.       (* the drones' states in the order of the pools *)
Variable better_first : list (cand * Z) -> list (cand * Z).
Hypothesis better_first_permutes : forall l, Permutation (better_first l) l.

Definition with_gain (seen : so_far_of) (p : pool cand) : pool (cand * Z) :=
  map (fun nl => (fst nl, map (fun c => (c, gain specs seen (amounts_up c))) (snd nl))) p.

Definition profit_gain (cg : cand * Z) : Z := snd cg - price (fst cg).
Definition low_gain (cg : cand * Z) : Z := snd cg - charge (fst cg).

Definition without_gain (p : pool (cand * Z)) : pool cand := map (fun nl => (fst nl, map fst (snd nl))) p.

(** Beside each item, the most of f of it and all that follow. *)
Fixpoint most_after {B} (f : B -> Z) (l : list B) : list (B * Z) :=
  match l with
  | [] => []
  | b :: rest => match most_after f rest with
                 | [] => [(b, f b)]
                 | ((b', m) :: _) as done => (b, Z.max (f b) m) :: done
                 end
  end.

Definition after (c : cand) (n : nat) (here : list cand) (others : pool cand) : pool cand :=
  let fits := fun d => negb (conflict (name c) (name d)) in
  let rest := map (fun nl => (fst nl, filter fits (snd nl))) others in
  match n with O => rest | _ => (n, filter fits here) :: rest end.

(** Each of some states in turn, n drones of this class being left besides the one that takes it. *)
Fixpoint each (explore : cand -> Z -> list cand -> A -> A) (so_far others : Z) (n : nat)
  (l : list (cand * Z * Z)) (found : A) : A :=
  match l with
  | [] => found
  | (c, g, m) :: rest =>
      if so_far + Z.of_nat (S n) * m + others <=? threshold found then found
      else each explore so_far others n rest (explore c g (c :: map (fun x => fst (fst x)) rest) found)
  end.

Fixpoint node (fuel : nat) (chosen : list cand) (seen : so_far_of) (profit low : Z) (bases : list base)
  (p : pool cand) (found : A) : A :=
  match p with
  | [] => take_down (rev chosen) found
  | _ =>
    match fuel with
    | O => found
    | S fuel' =>
      match keep_static (threshold found) 0 bases p with
      | None => found
      | Some p1 =>
        match keep (threshold found) profit profit_gain (with_gain seen p1) with
        | None => found
        | Some p2 =>
          match keep (-1) low low_gain p2 with
          | None | Some [] => found
          | Some ((n, l) :: others) =>
            match mosts profit_gain others with
            | None => found
            | Some ms =>
              let plain := without_gain others in
              each (fun c g here found =>
                      node fuel' (c :: chosen) (see specs seen (amounts_up c)) (profit + g - price c)
                        (low + g - charge c) (add_static bases (static c))
                        (after c (pred n) here plain) found)
                   profit (most_together others ms) (pred n)
                   (most_after profit_gain (better_first l)) found
            end
          end
        end
      end
    end
  end.

(** * Soundness: what is seen *)

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

Lemma specs_all_ok : Forall spec_ok specs.
Proof. apply Forall_forall. exact specs_ok. Qed.

Lemma nth_nonneg cs j : Forall (fun x => 0 <= x) cs -> 0 <= nth j cs 0.
Proof.
  intros H. destruct (nth_in_or_default j cs 0) as [Hin | ->]; [|lia].
  rewrite Forall_forall in H. apply H, Hin.
Qed.

Lemma together_nonneg l j : Forall cand_ok l -> 0 <= together l j.
Proof.
  intros H. apply sumZ_nonneg. intros c Hc. rewrite Forall_forall in H. apply nth_nonneg, (H c Hc).
Qed.

Lemma together_app a b j : together (a ++ b) j = together a j + together b j.
Proof. unfold together. rewrite map_app, sumZ_app. reflexivity. Qed.

Lemma gains_ok seen pre l : Forall cand_ok (pre ++ l) -> seen_ok specs seen (together pre) ->
  (F (pre ++ l) - F pre <= IZR (sumZ (map (fun c => gain specs seen (amounts_up c)) l)))%R.
Proof.
  intros Hok Hs. apply Forall_app in Hok. destruct Hok as [Hpre Hl].
  assert (H : forall e, (forall j, 0 <= e j) ->
    (worthR specs (fun j => together pre j + e j + together l j)%Z - worthR specs (fun j => together pre j + e j)%Z
     <= IZR (sumZ (map (fun c => gain specs seen (amounts_up c)) l)))%R).
  { induction Hl as [|c l Hc Hl IH]; intros e He.
    - simpl. unfold together at 2. simpl. rewrite (worth_ext _ _ (fun j => together pre j + e j)%Z) by (intros; lia). lra.
    - destruct Hc as [Hlen [Hpos Hup]].
      specialize (IH (fun j => e j + nth j (amounts c) 0)%Z).
      cbn [map sumZ]. rewrite plus_IZR.
      rewrite (worth_ext _ _ (fun j => together pre j + (e j + nth j (amounts c) 0) + together l j)%Z)
        by (intros; unfold together; simpl; lia).
      assert (He' : forall j, 0 <= e j + nth j (amounts c) 0) by (intros j; pose proof (He j); pose proof (nth_nonneg (amounts c) j Hpos); lia).
      specialize (IH He').
      pose proof (worth_shrinks specs specs_all_ok (together pre) e (fun j => nth j (amounts c) 0)
        (fun j => together_nonneg pre j Hpre) He (fun j => nth_nonneg _ j Hpos)) as D. cbv beta in D.
      destruct (gain_ok specs specs_all_ok seen (together pre) (amounts c) Hs (fun j => together_nonneg pre j Hpre) Hpos Hlen) as [G _].
      rewrite <- Hup in G.
      rewrite (worth_ext _ (fun j => together pre j + (e j + nth j (amounts c) 0))%Z
        (fun j => together pre j + e j + nth j (amounts c) 0)%Z) in IH by (intros; lia). lra. }
  specialize (H (fun _ => 0) ltac:(intros; lia)). unfold F.
  rewrite (worth_ext _ (together (pre ++ l)) (fun j => together pre j + 0 + together l j)%Z)
    by (intros; rewrite together_app; lia).
  rewrite (worth_ext _ (together pre) (fun j => together pre j + 0)%Z) by (intros; lia). exact H.
Qed.

Lemma see_next_ok seen pre c : Forall cand_ok pre -> cand_ok c -> seen_ok specs seen (together pre) ->
  seen_ok specs (see specs seen (amounts_up c)) (together (pre ++ [c])).
Proof.
  intros Hpre [Hlen [Hpos Hup]] Hs.
  destruct (gain_ok specs specs_all_ok seen (together pre) (amounts c) Hs (fun j => together_nonneg pre j Hpre) Hpos Hlen) as [_ G].
  rewrite <- Hup in G.
  assert (E : forall ss seen z z', (forall j, z j = z' j) -> seen_ok ss seen z -> seen_ok ss seen z').
  { clear. induction ss as [|s ss IH]; intros [|[low r] seen] z z' E H; simpl in *; try contradiction; [exact Logic.I|].
    rewrite <- E. destruct H as [H1 [H2 [H3 H4]]]. repeat split; try assumption. apply (IH _ (fun j => z (S j))); [intros; apply E | exact H4]. }
  apply (E _ _ _ _ (fun j => eq_refl)) in G. eapply E; [|exact G].
  intros j. rewrite together_app. unfold together at 3. simpl. lia.
Qed.

(** * Soundness: pools *)

Definition completes {B} (p : pool B) (Ls : list (list B)) : Prop :=
  Forall2 (fun nl L => length L = fst nl /\ incl L (snd nl)) p Ls.
Definition positive_counts {B} (p : pool B) : Prop := Forall (fun nl => (1 <= fst nl)%nat) p.
Definition drones_left {B} (p : pool B) : nat := fold_right (fun nl n => (fst nl + n)%nat) O p.
Definition within {B} (p p' : pool B) : Prop := Forall2 (fun a b => fst a = fst b /\ incl (snd a) (snd b)) p p'.

Lemma most_of_ok {B} (f : B -> Z) l a : In a l -> exists m, most_of f l = Some m /\ f a <= m.
Proof. intros H. exact (largest_in (fun a => Some (f a)) l None a (f a) H eq_refl). Qed.

Lemma most_times {B} (f : B -> Z) (m : Z) L : (forall a, In a L -> f a <= m) -> sumZ (map f L) <= Z.of_nat (length L) * m.
Proof.
  induction L as [|a L IH]; intros H; [simpl; lia|]. cbn [map sumZ length]. rewrite Nat2Z.inj_succ.
  pose proof (H a (or_introl eq_refl)). specialize (IH (fun b Hb => H b (or_intror Hb))). lia.
Qed.

Lemma mosts_ok {B} (f : B -> Z) (p : pool B) Ls : completes p Ls -> positive_counts p ->
  exists ms, mosts f p = Some ms
    /\ Forall2 (fun m L => forall a, In a L -> f a <= m) ms Ls
    /\ Forall2 (fun (nl : nat * list B) m => True) p ms
    /\ sumZ (map f (concat Ls)) <= most_together p ms.
Proof.
  induction 1 as [|[n l] L p Ls [Hlen Hin] H IH]; intros Hp.
  - exists []. repeat split; try constructor. simpl. lia.
  - apply Forall_cons_iff in Hp. destruct Hp as [Hn Hp]. simpl in Hn, Hlen, Hin.
    destruct (IH Hp) as [ms [Ems [Hms [Hpm Hsum]]]].
    destruct L as [|a L]; [simpl in Hlen; lia|].
    destruct (most_of_ok f l a (Hin a (or_introl eq_refl))) as [m [Em _]].
    assert (Hm : forall b, In b (a :: L) -> f b <= m).
    { intros b Hb. destruct (most_of_ok f l b (Hin b Hb)) as [m' [Em' Hb']]. congruence. }
    exists (m :: ms). cbn [mosts]. rewrite Em, Ems. repeat split; try (constructor; assumption || exact Logic.I).
    cbn [concat]. rewrite map_app, sumZ_app. cbn [most_together].
    pose proof (most_times f m (a :: L) Hm) as Hmt. rewrite Hlen in Hmt. lia.
Qed.

(** With one of its members at f a, what a completion adds up to is less than the most by m - f a. *)
Lemma keep_each_ok {B} (f : B -> Z) room (p : pool B) : forall Ls ms before,
  completes p Ls -> Forall2 (fun m L => forall a, In a L -> f a <= m) ms Ls ->
  before + most_together p ms - sumZ (map f (concat Ls)) < room -> 0 <= before ->
  completes (keep_each f room p ms) Ls.
Proof.
  induction p as [|[n l] p IH]; intros Ls ms before Hc Hm Hroom Hb; inversion Hc as [|? L ? Ls' [Hlen Hin] Hc']; subst; inversion Hm as [|m ? ms' ? HmL Hm']; subst.
  - constructor.
  - cbn [keep_each]. simpl in Hlen, Hin. cbn [most_together concat] in Hroom. rewrite map_app, sumZ_app in Hroom.
    assert (Hrest : 0 <= most_together p ms' - sumZ (map f (concat Ls'))).
    { clear - Hc' Hm'. revert ms' Hm'. induction Hc' as [|[n l] L p Ls [Hlen Hin] H IH]; intros ms Hm; inversion Hm as [|m ? ms' ? HmL Hm']; subst.
      - simpl. lia.
      - cbn [most_together concat]. rewrite map_app, sumZ_app. specialize (IH ms' Hm').
        pose proof (most_times f m L HmL) as Hmt. simpl in Hlen. rewrite Hlen in Hmt. lia. }
    pose proof (most_times f m L HmL) as Hmt. rewrite Hlen in Hmt.
    constructor.
    + split; [exact Hlen|]. simpl. intros a Ha. apply filter_In. split; [apply Hin, Ha|]. apply Z.ltb_lt.
      (* the others of this class are at most m *)
      enough (sumZ (map f L) <= (Z.of_nat n - 1) * m + f a) by lia.
      destruct (in_split a L Ha) as [L1 [L2 EL]]. subst L. rewrite map_app, sumZ_app. simpl.
      assert (H12 : sumZ (map f (L1 ++ L2)) <= Z.of_nat (length (L1 ++ L2)) * m).
      { apply most_times. intros b Hb'. apply HmL. apply in_app_iff in Hb'. apply in_app_iff. simpl. tauto. }
      rewrite map_app, sumZ_app in H12. rewrite app_length in H12, Hlen. simpl in Hlen.
      replace (Z.of_nat n - 1) with (Z.of_nat (length L1 + length L2)) by lia. lia.
    + apply (IH Ls' ms' (before + (Z.of_nat n * m - sumZ (map f L)))); try assumption; lia.
Qed.

Lemma keep_each_within {B} (f : B -> Z) room (p : pool B) : forall ms,
  Forall2 (fun (nl : nat * list B) (m : Z) => True) p ms -> within (keep_each f room p ms) p.
Proof.
  induction p as [|[n l] p IH]; intros ms H; inversion H; subst; cbn [keep_each]; constructor.
  - split; [reflexivity|]. apply incl_filter.
  - apply IH. assumption.
Qed.

Lemma keep_ok {B} threshold' base' (f : B -> Z) (p : pool B) Ls :
  completes p Ls -> positive_counts p -> threshold' < base' + sumZ (map f (concat Ls)) ->
  exists p', keep threshold' base' f p = Some p' /\ completes p' Ls /\ within p' p.
Proof.
  intros Hc Hp Ht. destruct (mosts_ok f p Ls Hc Hp) as [ms [Ems [Hms [Hpm Hsum]]]].
  unfold keep. rewrite Ems. cbv zeta.
  destruct (Z.leb_spec (base' + most_together p ms - threshold') 0) as [L | L]; [lia|].
  eexists. split; [reflexivity|]. split.
  - apply (keep_each_ok f _ p Ls ms 0); try assumption; lia.
  - apply keep_each_within. exact Hpm.
Qed.

Lemma within_counts {B} (p p' : pool B) : within p p' -> positive_counts p' -> positive_counts p.
Proof.
  induction 1 as [|a b p p' [E _] H IH]; intros Hp; [constructor|].
  apply Forall_cons_iff in Hp. destruct Hp. constructor; [rewrite E; assumption | apply IH; assumption].
Qed.

Lemma within_left {B} (p p' : pool B) : within p p' -> drones_left p = drones_left p'.
Proof. induction 1 as [|a b p p' [E _] H IH]; simpl; [reflexivity|]. rewrite E, IH. reflexivity. Qed.

Lemma within_trans {B} (p q r : pool B) : within p q -> within q r -> within p r.
Proof.
  intros H. revert r. induction H as [|a b p q [E I0] H IH]; intros r Hr; inversion Hr as [|? c ? r' [E' I'] Hr']; subst; constructor.
  - split; [congruence | eapply incl_tran; eassumption].
  - apply IH. assumption.
Qed.

Lemma within_refl {B} (p : pool B) : within p p.
Proof. induction p; constructor; [split; [reflexivity | apply incl_refl] | assumption]. Qed.

(** * Soundness: the bounds of a joint state *)

Definition static_sum (j : nat) (l : list cand) : Z := sumZ (map (fun c => nth j (static c) 0) l).

Definition fits_together (l : list cand) : Prop :=
  ForallOrdPairs (fun a b => conflict (name a) (name b) = false) l.

(** It keeps the static bounds, its worth less its charges is at least a floor, no two conflict. *)
Definition counts (first : list base) (floor : Z) (l : list cand) : Prop :=
  (forall j is_limit b, nth_error first j = Some (is_limit, b) ->
     if is_limit : bool then 0 <= b + static_sum j l else (profitR l <= IZR (b + static_sum j l))%R)
  /\ (IZR floor + IZR (sum charge l) <= F l)%R
  /\ fits_together l.

Lemma add_static_nth bs : forall vs j, nth_error (add_static bs vs) j
  = option_map (fun lb : base => (fst lb, snd lb + nth j vs 0)) (nth_error bs j).
Proof.
  induction bs as [|[l b] bs IH]; intros vs j.
  - destruct j, vs; reflexivity.
  - destruct vs as [|v vs], j as [|j]; simpl; try reflexivity.
    + rewrite Z.add_0_r. reflexivity.
    + destruct (nth_error bs j) as [[l' b']|]; simpl; [|reflexivity]. destruct j; rewrite Z.add_0_r; reflexivity.
    + apply IH.
Qed.

Definition bases_ok (first bases : list base) (pre : list cand) : Prop :=
  forall j, nth_error bases j = option_map (fun lb : base => (fst lb, snd lb + static_sum j pre)) (nth_error first j).

Lemma bases_first first : bases_ok first first [].
Proof.
  intros j. destruct (nth_error first j) as [[l b]|]; simpl; [|reflexivity].
  unfold static_sum. simpl. rewrite Z.add_0_r. reflexivity.
Qed.

Lemma bases_next first bases pre c : bases_ok first bases pre ->
  bases_ok first (add_static bases (static c)) (pre ++ [c]).
Proof.
  intros H j. rewrite add_static_nth, (H j). destruct (nth_error first j) as [[l b]|]; simpl; [|reflexivity].
  unfold static_sum. rewrite map_app, sumZ_app. simpl. f_equal. f_equal. lia.
Qed.

Lemma keep_static_ok best bases : forall j (p : pool cand) Ls, completes p Ls -> positive_counts p ->
  (forall i (is_limit : bool) b, nth_error bases i = Some (is_limit, b) ->
     (if is_limit then -1 else best) < b + static_sum (j + i) (concat Ls)) ->
  exists p', keep_static best j bases p = Some p' /\ completes p' Ls /\ within p' p.
Proof.
  induction bases as [|[l b] bases IH]; intros j p Ls Hc Hp H.
  - exists p. repeat split; [exact Hc | apply within_refl].
  - pose proof (H O l b eq_refl) as H0. rewrite Nat.add_0_r in H0.
    destruct (keep_ok (if l then -1 else best) b (fun c => nth j (static c) 0) p Ls Hc Hp H0) as [p1 [E1 [C1 W1]]].
    cbn [keep_static]. rewrite E1.
    destruct (IH (S j) p1 Ls C1 (within_counts _ _ W1 Hp)) as [p2 [E2 [C2 W2]]].
    { intros i l' b' Hi. specialize (H (S i) l' b' Hi). replace (S j + i)%nat with (j + S i)%nat by lia. exact H. }
    exists p2. repeat split; [exact E2 | exact C2 | eapply within_trans; eassumption].
Qed.

Definition with_its_gain (seen : so_far_of) (c : cand) : cand * Z := (c, gain specs seen (amounts_up c)).

Lemma with_gain_completes seen p Ls : completes p Ls ->
  completes (with_gain seen p) (map (map (with_its_gain seen)) Ls).
Proof.
  induction 1 as [|[n l] L p Ls [Hlen Hin] H IH]; simpl; constructor; [|exact IH]. simpl in *.
  rewrite map_length. split; [exact Hlen|]. intros x Hx. apply in_map_iff in Hx. destruct Hx as [c [<- Hc]].
  apply in_map_iff. exists c. split; [reflexivity | apply Hin, Hc].
Qed.

Lemma with_gain_counts seen p : positive_counts p -> positive_counts (with_gain seen p).
Proof. induction 1; simpl; constructor; assumption. Qed.

Lemma concat_map_map {B C} (f : B -> C) Ls : concat (map (map f) Ls) = map f (concat Ls).
Proof. symmetry. apply concat_map. Qed.

Lemma without_gain_completes (p : pool (cand * Z)) Ls :
  completes p Ls -> completes (without_gain p) (map (map fst) Ls).
Proof.
  induction 1 as [|[n l] L p Ls [Hlen Hin] H IH]; simpl; constructor; [|exact IH]. simpl in *.
  rewrite map_length. split; [exact Hlen|]. intros x Hx. apply in_map_iff in Hx. destruct Hx as [c [<- Hc]].
  apply in_map, Hin, Hc.
Qed.

Lemma map_fst_gain seen l : map fst (map (with_its_gain seen) l) = l.
Proof. rewrite map_map. apply map_id. Qed.

Lemma most_after_fst {B} (f : B -> Z) l : map fst (most_after f l) = l.
Proof.
  induction l as [|b l IH]; [reflexivity|]. simpl. destruct (most_after f l) as [|[b' m] r] eqn:E.
  - simpl in IH. subst l. reflexivity.
  - simpl in *. f_equal. exact IH.
Qed.

Lemma most_after_ok {B} (f : B -> Z) l : forall b m rest, most_after f l = (b, m) :: rest ->
  f b <= m /\ (forall x, In x rest -> f (fst x) <= m).
Proof.
  induction l as [|a l IH]; intros b m rest E; [discriminate|]. simpl in E.
  destruct (most_after f l) as [|[b' m'] r] eqn:E'.
  - injection E as <- <- <-. split; [lia | intros x []].
  - injection E as <- <- <-. destruct (IH b' m' r eq_refl) as [H1 H2]. split; [lia|].
    intros x [<- | Hx]; [simpl; lia|]. specialize (H2 x Hx). lia.
Qed.

Lemma most_after_tail {B} (f : B -> Z) l x rest : most_after f l = x :: rest -> rest = most_after f (map fst rest).
Proof.
  destruct l as [|a l]; [discriminate|]. simpl. intros E.
  assert (Er : rest = most_after f l).
  { destruct (most_after f l) as [|[b m] r]; injection E as <- <-; reflexivity. }
  rewrite Er at 2. rewrite most_after_fst. exact Er.
Qed.

(** * Soundness: nothing that counts is left out *)

Hypothesis who_dec : forall a b : who, {a = b} + {a <> b}.

Lemma cand_dec (a b : cand * Z) : {a = b} + {a <> b}.
Proof.
  destruct a as [a g], b as [b h]. destruct (Z.eq_dec g h) as [-> | N]; [|right; congruence].
  assert (H : {a = b} + {a <> b}) by (decide equality; auto using Z.eq_dec, (list_eq_dec Z.eq_dec)).
  destruct H as [-> | N]; [left; reflexivity | right; congruence].
Qed.

Variable Good : list cand -> A -> Prop.
Hypothesis Good_low : forall l a, (profitR l <= IZR (threshold a))%R -> Good l a.
Hypothesis Good_down : forall l a, Good l (take_down l a).
Hypothesis Good_keep : forall l l' a, Good l a -> Good l (take_down l' a).
Variable singles : bool.   (* each class has one drone: then the order does not change *)
Hypothesis Good_swap : singles = false -> forall pre x c y post a,
  Good (pre ++ c :: x ++ y ++ post) a -> Good (pre ++ x ++ c :: y ++ post) a.

Lemma each_keeps L explore so_far others n : (forall c g here a, Good L a -> Good L (explore c g here a)) ->
  forall l a, Good L a -> Good L (each explore so_far others n l a).
Proof.
  intros He. induction l as [|[[c g] m] l IH]; intros a H; simpl; [exact H|].
  destruct (_ <=? _); [exact H|]. apply IH, He, H.
Qed.

Lemma node_keeps L fuel : forall chosen seen profit low bases p a, Good L a ->
  Good L (node fuel chosen seen profit low bases p a).
Proof.
  induction fuel as [|fuel IH]; intros chosen seen profit low bases p a H; destruct p as [|q p]; simpl; try (apply Good_keep, H); try exact H.
  destruct (keep_static _ _ _ _) as [p1|]; [|exact H]. destruct (keep _ _ _ _) as [p2|]; [|exact H].
  destruct (keep _ _ _ _) as [[|[n l] others]|]; try exact H.
  destruct (mosts _ _) as [ms|]; [|exact H]. apply each_keeps; [|exact H]. intros. apply IH. assumption.
Qed.

Lemma F_perm l l' : Permutation l l' -> F l = F l'.
Proof.
  intros H. unfold F. apply worth_ext. intros j. unfold together.
  induction H; simpl; lia.
Qed.

Lemma sum_perm f l l' : Permutation l l' -> sum f l = sum f l'.
Proof. intros H. unfold sum. induction H; simpl; lia. Qed.

Lemma static_perm j l l' : Permutation l l' -> static_sum j l = static_sum j l'.
Proof. intros H. unfold static_sum. induction H; simpl; lia. Qed.

Lemma fits_perm l l' : Permutation l l' -> fits_together l -> fits_together l'.
Proof.
  unfold fits_together. induction 1 as [|x l l' H IH | x y l | l l' l'' H IH H' IH']; intros Hf; auto.
  - inversion Hf; subst. constructor; [|apply IH; assumption].
    eapply Permutation_Forall; eassumption.
  - inversion Hf as [|? ? Hy Hf']; subst. inversion Hf' as [|? ? Hx Hf'']; subst.
    inversion Hy as [|? ? Hyx Hyl]; subst. constructor; [|constructor; assumption].
    constructor; [rewrite conflict_symmetric; assumption | assumption].
Qed.

Lemma counts_perm first floor l l' : Permutation l l' -> counts first floor l -> counts first floor l'.
Proof.
  intros H [H1 [H2 H3]]. split; [|split].
  - intros j il b E. specialize (H1 j il b E). unfold profitR in *.
    rewrite <- (F_perm _ _ H), <- (sum_perm price _ _ H), <- (static_perm j _ _ H). exact H1.
  - rewrite <- (F_perm _ _ H), <- (sum_perm charge _ _ H). exact H2.
  - eapply fits_perm; eassumption.
Qed.

Lemma fits_later pre c post d : fits_together (pre ++ c :: post) -> In d post -> conflict (name c) (name d) = false.
Proof.
  unfold fits_together. induction pre as [|x pre IH]; simpl; intros H Hd.
  - inversion H as [|? ? Hc _]; subst. rewrite Forall_forall in Hc. apply Hc, Hd.
  - inversion H; subst. apply IH; assumption.
Qed.

Lemma after_completes c n here others L Ls :
  (forall d, In d (L ++ concat Ls) -> conflict (name c) (name d) = false) ->
  length L = n -> incl L here -> completes others Ls ->
  exists Ls', completes (after c n here others) Ls' /\ concat Ls' = L ++ concat Ls
    /\ (positive_counts others -> positive_counts (after c n here others))
    /\ drones_left (after c n here others) = (n + drones_left others)%nat.
Proof.
  intros Hf Hlen Hin Ho.
  assert (Hrest : completes (map (fun nl => (fst nl, filter (fun d => negb (conflict (name c) (name d))) (snd nl))) others) Ls).
  { assert (Hf' : forall d, In d (concat Ls) -> conflict (name c) (name d) = false) by (intros; apply Hf, in_app_iff; auto).
    clear - Ho Hf'. induction Ho as [|[m l] L' p Ls [Hl Hi] H IH]; simpl; constructor.
    - simpl in *. split; [exact Hl|]. intros d Hd. apply filter_In. split; [apply Hi, Hd|].
      rewrite Hf'; [reflexivity | apply in_app_iff; auto].
    - apply IH. intros d Hd. apply Hf', in_app_iff. auto. }
  assert (Hpos : positive_counts others -> positive_counts (map (fun nl => (fst nl, filter (fun d => negb (conflict (name c) (name d))) (snd nl))) others)).
  { clear. induction 1; simpl; constructor; assumption. }
  assert (Hleft : drones_left (map (fun nl => (fst nl, filter (fun d => negb (conflict (name c) (name d))) (snd nl))) others) = drones_left others).
  { clear. induction others as [|[m l] p IH]; simpl; [reflexivity | rewrite IH; reflexivity]. }
  unfold after. destruct n as [|n].
  - destruct L; [|discriminate]. exists Ls. repeat split; try assumption.
  - exists (L :: Ls). repeat split.
    + constructor; [|exact Hrest]. simpl. split; [exact Hlen|]. intros d Hd. apply filter_In.
      split; [apply Hin, Hd|]. rewrite Hf; [reflexivity | apply in_app_iff; auto].
    + intros Hp. constructor; [simpl; lia | apply Hpos, Hp].
    + cbn [drones_left fold_right fst]. f_equal. exact Hleft.
Qed.

Variables (first : list base) (floor : Z).

(** All of a joint state that counts, the drones so far among it: it is taken down or bounded. *)
Theorem node_ok fuel : forall pre seen profit low bases p a Ls,
  completes p Ls -> positive_counts p -> (drones_left p <= fuel)%nat ->
  (singles = true -> Forall (fun nl => fst nl = 1%nat) p) ->
  Forall cand_ok (pre ++ concat Ls) -> seen_ok specs seen (together pre) ->
  (F pre - IZR (sum price pre) <= IZR profit)%R ->
  (F pre - IZR (sum charge pre) - IZR floor <= IZR low)%R ->
  bases_ok first bases pre -> counts first floor (pre ++ concat Ls) ->
  Good (pre ++ concat Ls) (node fuel (rev pre) seen profit low bases p a).
Proof.
  induction fuel as [|fuel IH]; intros pre seen profit low bases p a Ls Hc Hp Hfuel Hsingle Hok Hseen Hprofit Hlow Hbases Hcounts.
  - destruct p as [|[n l] p].
    + inversion Hc; subst. simpl. rewrite rev_involutive, app_nil_r. apply Good_down.
    + apply Forall_cons_iff in Hp. simpl in *. lia.
  - destruct p as [|[n0 l0] p0].
    { inversion Hc; subst. simpl. rewrite rev_involutive, app_nil_r. apply Good_down. }
    set (p := (n0, l0) :: p0) in *. set (L := pre ++ concat Ls) in *.
    destruct (Rle_dec (profitR L) (IZR (threshold a))) as [Hle | Hgt].
    { apply node_keeps, Good_low, Hle. }
    apply Rnot_le_lt in Hgt.
    pose proof (gains_ok seen pre (concat Ls) Hok Hseen) as Hgains. fold L in Hgains.
    assert (Esum : forall f, sum f L = sum f pre + sum f (concat Ls)).
    { intros f. unfold L, sum. rewrite map_app, sumZ_app. reflexivity. }
    pose proof (Esum price) as Eprice. pose proof (Esum charge) as Echarge.
    destruct Hcounts as [Hstatic [Hfloor Hfits]].
    (* the static bounds *)
    destruct (keep_static_ok (threshold a) bases 0 p Ls Hc Hp) as [p1 [E1 [C1 W1]]].
    { intros j il b Hj. pose proof (eq_trans (eq_sym Hj) (Hbases j)) as Hj'.
      destruct (nth_error first j) as [[il' b']|] eqn:Ej; [|discriminate Hj'].
      injection Hj' as -> ->. specialize (Hstatic j il' b' Ej).
      assert (Es : static_sum j L = static_sum j pre + static_sum j (concat Ls)).
      { unfold static_sum, L. rewrite map_app, sumZ_app. reflexivity. }
      simpl. destruct il'.
      - lia.
      - apply lt_IZR. eapply Rlt_le_trans; [exact Hgt|]. eapply Rle_trans; [exact Hstatic|]. apply IZR_le. lia. }
    pose proof (within_counts _ _ W1 Hp) as P1.
    set (Gs := map (map (with_its_gain seen)) Ls).
    pose proof (with_gain_completes seen p1 Ls C1) as CG. fold Gs in CG.
    assert (Esums : forall f : cand -> Z, sumZ (map (fun cg : cand * Z => snd cg - f (fst cg)) (concat Gs))
        = sumZ (map (fun c => gain specs seen (amounts_up c)) (concat Ls)) - sum f (concat Ls)).
    { intros f. unfold Gs. rewrite concat_map_map, map_map. unfold sum. simpl.
      clear. induction (concat Ls) as [|c l IHl]; [reflexivity|]. cbn [map sumZ]. rewrite IHl. lia. }
    (* profits *)
    destruct (keep_ok (threshold a) profit profit_gain (with_gain seen p1) Gs CG (with_gain_counts seen p1 P1)) as [p2 [E2 [C2 W2]]].
    { unfold profit_gain. rewrite (Esums price). apply lt_IZR. rewrite plus_IZR, minus_IZR.
      unfold profitR in Hgt. rewrite Eprice, plus_IZR in Hgt. lra. }
    pose proof (within_counts _ _ W2 (with_gain_counts seen p1 P1)) as P2.
    (* worth less charges *)
    destruct (keep_ok (-1) low low_gain p2 Gs C2 P2) as [p3 [E3 [C3 W3]]].
    { unfold low_gain. rewrite (Esums charge). apply lt_IZR. rewrite plus_IZR, minus_IZR.
      rewrite Echarge, plus_IZR in Hfloor. lra. }
    pose proof (within_counts _ _ W3 P2) as P3.
    unfold p in E1 |- *. cbn [node]. rewrite E1, E2, E3. fold p.
    destruct p3 as [|[n l] others].
    { inversion C3 as [EG|]. exfalso. unfold Gs in *. destruct Ls; [inversion Hc | discriminate]. }
    destruct Gs as [|G1 Gs'] eqn:EGs; [inversion C3|].
    destruct Ls as [|L1 Ls']; [discriminate|]. injection EGs as EG1 EGs'.
    apply Forall2_head in C3. destruct C3 as [[HlenG HinG] C3]. simpl in HlenG, HinG.
    apply Forall_cons_iff in P3. destruct P3 as [Hn P3]. simpl in Hn.
    destruct (mosts_ok profit_gain others Gs' C3 P3) as [ms [Ems [_ [_ Hmost]]]].
    rewrite Ems.
    assert (Hleft : (n + drones_left others <= S fuel)%nat).
    { pose proof (within_left _ _ W3) as E. rewrite (within_left _ _ W2) in E. simpl in E.
      assert (Eg : drones_left (with_gain seen p1) = drones_left p1).
      { clear. induction p1 as [|[m l] q IHq]; simpl; [reflexivity | rewrite IHq; reflexivity]. }
      rewrite Eg, (within_left _ _ W1) in E. lia. }
    assert (Hsingle' : singles = true -> n = 1%nat /\ Forall (fun nl => fst nl = 1%nat) others).
    { intros Hs. specialize (Hsingle Hs).
      assert (Hw : forall B (q q' : pool B), within q q' -> Forall (fun nl => fst nl = 1%nat) q' -> Forall (fun nl => fst nl = 1%nat) q).
      { clear. induction 1 as [|x y q q' [E _] H IH]; intros Hq; constructor; apply Forall_cons_iff in Hq; destruct Hq.
        - congruence.
        - apply IH. assumption. }
      apply (Hw _ _ _ W1) in Hsingle.
      assert (Hg : Forall (fun nl => fst nl = 1%nat) (with_gain seen p1)).
      { clear - Hsingle. induction Hsingle; simpl; constructor; assumption. }
      apply (Hw _ _ _ W2), (Hw _ _ _ W3) in Hg. apply Forall_cons_iff in Hg. exact Hg. }
    assert (EL1 : map fst G1 = L1) by (rewrite <- EG1; apply map_fst_gain).
    assert (ELs : map (map fst) Gs' = Ls').
    { rewrite <- EGs', map_map. rewrite <- (map_id Ls') at 2. apply map_ext. intros x. apply map_fst_gain. }
    pose proof (without_gain_completes others Gs' C3) as Cplain. rewrite ELs in Cplain.
    assert (Pplain : positive_counts (without_gain others)).
    { clear - P3. induction P3; simpl; constructor; assumption. }
    assert (Lplain : drones_left (without_gain others) = drones_left others).
    { clear. induction others as [|[m q] o IHo]; simpl; [reflexivity | rewrite IHo; reflexivity]. }
    assert (Hgain : forall cg, In cg G1 -> snd cg = gain specs seen (amounts_up (fst cg))).
    { intros cg Hcg. rewrite <- EG1 in Hcg. apply in_map_iff in Hcg. destruct Hcg as [c [<- _]]. reflexivity. }
    assert (Hbound : (profitR L <= IZR (profit + (sumZ (map profit_gain G1) + most_together others ms)))%R).
    { assert (E : sumZ (map profit_gain (concat (G1 :: Gs'))) = sumZ (map (fun c => gain specs seen (amounts_up c)) (concat (L1 :: Ls'))) - sum price (concat (L1 :: Ls'))).
      { apply (Esums price). }
      cbn [concat] in E. rewrite map_app, sumZ_app in E. rewrite !plus_IZR.
      apply IZR_le in Hmost. apply (f_equal IZR) in E. rewrite plus_IZR, minus_IZR in E.
      unfold profitR. rewrite Eprice, plus_IZR. cbn [concat] in *. lra. }
    assert (Hin_sorted : incl G1 (better_first l)).
    { intros x Hx. eapply Permutation_in; [apply Permutation_sym, better_first_permutes | apply HinG, Hx]. }
    set (items := most_after profit_gain (better_first l)).
    assert (Hitems : exists l', items = most_after profit_gain l' /\ incl G1 (map fst items)).
    { exists (better_first l). split; [reflexivity|]. unfold items. rewrite most_after_fst. exact Hin_sorted. }
    clearbody items. clear Hin_sorted HinG E1 E2 E3 C1 C2 W1 W2 W3 CG.
    revert a Hgt Hitems. induction items as [|[cg m] items IHi]; intros a Hgt [l' [Eitems Hincl]].
    { exfalso. destruct G1 as [|x G1]; [simpl in HlenG; lia | exact (Hincl x (or_introl eq_refl))]. }
    destruct cg as [c g]. cbn [each].
    destruct (most_after_ok profit_gain l' (c, g) m items (eq_sym Eitems)) as [Hm1 Hm2].
    assert (Hall : forall x, In x G1 -> profit_gain x <= m).
    { intros x Hx. specialize (Hincl x Hx). simpl in Hincl. destruct Hincl as [<- | Hx']; [exact Hm1|].
      apply in_map_iff in Hx'. destruct Hx' as [y [<- Hy]]. apply Hm2, Hy. }
    pose proof (most_times profit_gain m G1 Hall) as Hmt. rewrite HlenG in Hmt.
    replace (S (pred n)) with n by lia.
    destruct (Z.leb_spec (profit + Z.of_nat n * m + most_together others ms) (threshold a)) as [Hend | Hgo].
    { apply Good_low. eapply Rle_trans; [exact Hbound|]. apply IZR_le. lia. }
    assert (Hrec : forall c0 g0 here a0, Good L a0 -> Good L
      ((fun c g here found => node fuel (c :: rev pre) (see specs seen (amounts_up c)) (profit + g - price c)
          (low + g - charge c) (add_static bases (static c)) (after c (pred n) here (without_gain others)) found) c0 g0 here a0)).
    { intros. apply node_keeps. assumption. }
    destruct (in_dec cand_dec (c, g) G1) as [Hcin | Hcout].
    + (* it is taken *)
      apply each_keeps; [exact Hrec|].
      destruct (in_split _ _ Hcin) as [X [Y EXY]].
      assert (Eg : g = gain specs seen (amounts_up c)) by (apply (Hgain (c, g) Hcin)).
      assert (EL : L = pre ++ map fst X ++ c :: map fst Y ++ concat Ls').
      { unfold L. cbn [concat]. rewrite <- EL1, EXY, map_app. simpl. rewrite <- !app_assoc. reflexivity. }
      assert (Hperm : Permutation L (pre ++ c :: (map fst X ++ map fst Y) ++ concat Ls')).
      { rewrite EL, <- app_assoc. apply Permutation_app_head. symmetry. apply Permutation_middle. }
      set (L' := (pre ++ [c]) ++ (map fst X ++ map fst Y) ++ concat Ls').
      assert (EL' : L' = pre ++ c :: (map fst X ++ map fst Y) ++ concat Ls') by (unfold L'; rewrite <- app_assoc; reflexivity).
      rewrite <- EL' in Hperm.
      pose proof (counts_perm first floor L L' Hperm (conj Hstatic (conj Hfloor Hfits))) as Hcounts'.
      assert (HokL' : Forall cand_ok L') by (eapply Permutation_Forall; eassumption).
      assert (Hcok : cand_ok c /\ Forall cand_ok pre).
      { rewrite EL' in HokL'. apply Forall_app in HokL'. destruct HokL' as [Hpre' H']. apply Forall_cons_iff in H'. tauto. }
      destruct Hcok as [Hcok Hpreok].
      destruct (after_completes c (pred n) (c :: map (fun x => fst (fst x)) items) (without_gain others)
                  (map fst X ++ map fst Y) Ls') as [Ls2 [Ca [Ea [Pa La]]]].
      { intros d Hd. destruct Hcounts' as [_ [_ Hf']]. rewrite EL' in Hf'. apply (fits_later _ _ _ _ Hf' Hd). }
      { rewrite <- map_app, map_length. rewrite EXY in HlenG. rewrite app_length in HlenG |- *. simpl in HlenG. lia. }
      { intros d Hd. rewrite <- map_app in Hd. apply in_map_iff in Hd. destruct Hd as [x [<- Hx]].
        assert (HxG : In x G1).
        { rewrite EXY. apply in_app_iff in Hx. apply in_app_iff. simpl. tauto. }
        specialize (Hincl x HxG). simpl in Hincl. destruct Hincl as [<- | Hx']; [left; reflexivity|]. right.
        apply in_map_iff in Hx'. destruct Hx' as [y [<- Hy]]. apply in_map_iff. exists y. auto. }
      { exact Cplain. }
      assert (EL2 : L' = (pre ++ [c]) ++ concat Ls2) by (rewrite Ea; reflexivity).
      assert (HG : Good L' (node fuel (c :: rev pre) (see specs seen (amounts_up c)) (profit + g - price c)
          (low + g - charge c) (add_static bases (static c))
          (after c (pred n) (c :: map (fun x => fst (fst x)) items) (without_gain others)) a)).
      { rewrite EL2. replace (c :: rev pre) with (rev (pre ++ [c])) by (rewrite rev_app_distr; reflexivity).
        pose proof (gains_ok seen pre [c] ltac:(apply Forall_app; split; [exact Hpreok | constructor; [exact Hcok | constructor]]) Hseen) as Hone.
        cbn [map sumZ] in Hone. rewrite Z.add_0_r, <- Eg in Hone.
        assert (Eone : forall f, sum f (pre ++ [c]) = sum f pre + f c).
        { intros f. unfold sum. rewrite map_app, sumZ_app. simpl. lia. }
        apply IH.
        - exact Ca.
        - apply Pa, Pplain.
        - rewrite La, Lplain. lia.
        - intros Hs. destruct (Hsingle' Hs) as [-> Ho]. unfold after. simpl.
          clear - Ho. induction Ho as [|[m q] o E Ho IHo]; simpl; constructor; assumption.
        - rewrite <- EL2. exact HokL'.
        - apply see_next_ok; assumption.
        - rewrite Eone, plus_IZR, minus_IZR, plus_IZR. lra.
        - rewrite Eone, plus_IZR, minus_IZR, plus_IZR. lra.
        - apply bases_next, Hbases.
        - rewrite <- EL2. exact Hcounts'. }
      destruct singles eqn:Es.
      * destruct (Hsingle' eq_refl) as [En _].
        assert (EX : X = []).
        { rewrite EXY, app_length in HlenG. simpl in HlenG. destruct X; [reflexivity | simpl in HlenG; lia]. }
        subst X. simpl in EL, L'. rewrite EL. unfold L' in HG. rewrite <- app_assoc in HG. exact HG.
      * rewrite EL. rewrite EL', <- app_assoc in HG. apply (Good_swap eq_refl). exact HG.
    + (* it is not *)
      destruct (Rle_dec (profitR L) (IZR (threshold (node fuel (c :: rev pre) (see specs seen (amounts_up c)) (profit + g - price c)
          (low + g - charge c) (add_static bases (static c))
          (after c (pred n) (c :: map (fun x => fst (fst x)) items) (without_gain others)) a)))) as [Hle | Hgt'].
      * apply each_keeps; [exact Hrec | apply Good_low, Hle].
      * apply Rnot_le_lt in Hgt'. apply IHi; [exact Hgt'|].
        exists (map fst items). split.
        -- symmetry. symmetry. apply (most_after_tail profit_gain l' (c, g, m)). symmetry. exact Eitems.
        -- intros x Hx. specialize (Hincl x Hx). simpl in Hincl. destruct Hincl as [E | Hx']; [|exact Hx'].
           exfalso. apply Hcout. rewrite E. exact Hx.
Qed.
End Search.
