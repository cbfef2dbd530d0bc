(** A search through joint states, drone by drone, that leaves out none that counts.

    Gains only shrink as more is seen, so that what the drones left would each gain now bounds what
    they gain together. Where that is not enough, numbers from outside say how to bound it better:
    they may be any, and what they prove is computed here. A joint state that is complete is handed
    on. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation.
From CocapCheck Require Import Spec Sums Returns Gains Tangents Pools.
Import ListNotations.
Open Scope Z_scope.

(** Numbers for a node: of its conditions - profit, worth less charges, static bounds - a share each;
    of its groups, where tangents touch; of its classes, levels.  Nothing is asked of them. *)
Record advice := Advice { shares : list Z; touches : list touch; levels : list Z }.

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

Variable specs : list spec.

Notation spec_of := (spec_of weight_unit precision coarse).
Notation coarse_up := (coarse_up amount_unit coarse).
Notation gain := (gain coarse).
Notation see := (see coarse).
Notation worthR := (worthR amount_unit weight_unit precision).
Notation seen_ok := (seen_ok amount_unit coarse).

Hypothesis specs_ok : forall s, In s specs ->
  exists w r, s = spec_of w r /\ 0 <= w /\ is_return r.

Definition cand_ok (c : cand) : Prop :=
  length (amounts c) = length specs /\ Forall (fun x => 0 <= x) (amounts c) /\ amounts_up c = map coarse_up (amounts c).

Definition nothing : so_far_of := map (fun _ => (0, 0)) specs.

Definition together (l : list cand) (j : nat) : Z := sumZ (map (fun c => nth j (amounts c) 0) l).
Definition F (l : list cand) : R := worthR specs (together l).
Definition sum (f : cand -> Z) (l : list cand) : Z := sumZ (map f l).
Definition profitR (l : list cand) : R := (F l - IZR (sum price l))%R.

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

Definition with_gain (seen : so_far_of) (p : pool cand) : pool (cand * Z) :=
  map (fun nl => (fst nl, map (fun c => (c, gain specs seen (amounts_up c))) (snd nl))) p.

Definition profit_gain (cg : cand * Z) : Z := snd cg - price (fst cg).
Definition low_gain (cg : cand * Z) : Z := snd cg - charge (fst cg).

Definition firsts {B C} (p : pool (B * C)) : pool B := map (fun nl => (fst nl, map fst (snd nl))) p.

(** A sum of numbers with shares; shares below 0 are none. *)
Fixpoint weigh (ws xs : list Z) : Z :=
  match ws, xs with
  | w :: ws', x :: xs' => Z.max 0 w * x + weigh ws' xs'
  | _, _ => 0
  end.

Definition meet_1 (a b : cand) : bool := conflict (name a) (name b).
Definition meet_2 (a b : cand * Z) : bool := meet_1 (fst a) (fst b).
Definition meet_3 (a b : cand * Z * Z) : bool := meet_2 (fst a) (fst b).

(** Levels for the classes; those that have none are covered by their largest number. *)
Fixpoint by_levels (ls : list Z) (p : pool (cand * Z * Z)) : list (nat -> list (cand * Z * Z) -> option cover) :=
  match p with
  | [] => []
  | _ :: rest => match ls with
                 | [] => by_most snd :: by_levels [] rest
                 | level :: ls' => by_level meet_3 level snd :: by_levels ls' rest
                 end
  end.

(** Drops what cannot fulfil a sum of all conditions: each is a constant of the node and a number of
    each drone left, together not below 0.  What is gained stands in the first two. *)
Definition relax (a : advice) (seen : so_far_of) (profit low : Z) (statics : list Z) (p : pool (cand * Z)) : option (pool (cand * Z)) :=
  let ls := lines_of coarse specs seen (touches a) in
  let more := relaxed_constant specs ls in
  let ws := firstn (2 + length statics) (shares a) in
  let number (cg : cand * Z) :=
    let c := fst cg in
    let g := relaxed_gain coarse specs seen ls (amounts_up c) in
    weigh ws (g - price c :: g - charge c :: static c) in
  let numbered := map (fun nl => (fst nl, map (fun cg => (cg, number cg)) (snd nl))) p in
  match keep_by (by_levels (levels a) numbered) (-1) (weigh ws (profit + more :: low + more :: statics)) snd numbered with
  | None => None
  | Some kept => Some (firsts kept)
  end.

(** What is left of the static bounds, above what is wanted. *)
Definition statics_above (best : Z) (bases : list base) : list Z :=
  map (fun lb : base => if fst lb then snd lb else snd lb - best) bases.

Variable A : Type.                              (* what it brings back *)
Variable threshold : A -> Z.                    (* joint states of no more profit do not matter *)
Variable take_down : list cand -> A -> A.       (* the drones' states in the order of the pools *)
Variable better_first : list (cand * Z) -> list (cand * Z).
Hypothesis better_first_permutes : forall l, Permutation (better_first l) l.

(** Who gives advice: by what is seen, what the conditions leave, who is left with what states and
    gains; and by what it has made up its mind about at the node above. *)
Variable memory : Type.
Variable advise : so_far_of -> list Z -> pool (cand * Z) -> memory -> option advice * memory.

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
  let meets := conflict (name c) in let fits := fun d => negb (meets (name d)) in
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

(** Asks for advice until there is none, or nobody is left, or it is enough; also returns the mind. *)
Fixpoint advised (times : nat) (seen : so_far_of) (profit low : Z) (statics : list Z) (p : pool (cand * Z)) (mind : memory) : option (pool (cand * Z)) * memory :=
  match times with
  | O => (Some p, mind)
  | S times' =>
      let (told, mind') := advise seen (profit :: low :: statics) p mind in
      match told with
      | None => (Some p, mind')
      | Some a => match relax a seen profit low statics p with
                  | None => (None, mind')
                  | Some p' => advised times' seen profit low statics p' mind'
                  end
      end
  end.

Definition most_advice : nat := 100.

Fixpoint node (fuel : nat) (chosen : list cand) (seen : so_far_of) (profit low : Z) (bases : list base)
  (p : pool cand) (mind : memory) (found : A) : A :=
  match p with
  | [] => take_down (rev chosen) found
  | _ =>
    match fuel with
    | O => found
    | S fuel' =>
      let best := threshold found in
      match keep_static best 0 bases p with
      | None => found
      | Some p1 =>
        match keep best profit profit_gain (with_gain seen p1) with
        | None => found
        | Some p2 =>
          match keep (-1) low low_gain p2 with
          | None => found
          | Some p3 =>
            let (p4, mind') := advised most_advice seen (profit - best) low (statics_above best bases) p3 mind in
            match p4 with
            | None | Some [] => found
            | Some ((n, l) :: others) =>
              match mosts profit_gain others with
              | None => found
              | Some ms =>
                let plain := firsts others in
                each (fun c g here found =>
                        node fuel' (c :: chosen) (see specs seen (amounts_up c)) (profit + g - price c)
                          (low + g - charge c) (add_static bases (static c))
                          (after c (pred n) here plain) mind' found)
                     profit (most_together others ms) (pred n)
                     (most_after profit_gain (better_first l)) found
              end
            end
          end
        end
      end
    end
  end.

(** * Soundness: what is seen *)

Notation spec_ok := (spec_ok weight_unit precision coarse).
Notation worth_ext := (worth_ext amount_unit weight_unit precision).
Notation worth_shrinks := (worth_shrinks amount_unit weight_unit precision coarse amount_unit_pos weight_unit_pos precision_pos).
Notation gain_ok := (gain_ok amount_unit weight_unit precision coarse amount_unit_pos weight_unit_pos precision_pos coarse_pos).

Lemma specs_all_ok : Forall spec_ok specs.
Proof. apply Forall_forall. exact specs_ok. Qed.

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

(** Conflicts within the classes of what fits together. *)
Lemma no_two_map {B C} (meets : C -> C -> bool) (g : B -> C) L :
  no_two_meet meets (map g L) -> no_two_meet (fun a b => meets (g a) (g b)) L.
Proof.
  unfold no_two_meet. induction L as [|a L IH]; simpl; intros H; inversion H as [|? ? Ha H']; subst; constructor; [|apply IH, H'].
  rewrite Forall_map in Ha. exact Ha.
Qed.

Lemma fits_app a b : fits_together (a ++ b) -> fits_together a /\ fits_together b.
Proof.
  unfold fits_together. induction a as [|x a IH]; simpl; intros H; [split; [constructor | exact H]|].
  inversion H as [|? ? Hx H']; subst. destruct (IH H') as [H1 H2]. apply Forall_app in Hx. split; [constructor; tauto | exact H2].
Qed.

Lemma fits_classes Ls : fits_together (concat Ls) -> Forall (no_two_meet meet_1) Ls.
Proof.
  induction Ls as [|L Ls IH]; simpl; intros H; constructor; destruct (fits_app _ _ H) as [H1 H2]; [exact H1 | apply IH, H2].
Qed.

Lemma keep_static_ok best bases : forall j (p : pool cand) Ls, completes p Ls -> positive_counts p ->
  Forall (no_two_meet meet_1) Ls ->
  (forall i (is_limit : bool) b, nth_error bases i = Some (is_limit, b) ->
     (if is_limit then -1 else best) < b + static_sum (j + i) (concat Ls)) ->
  exists p', keep_static best j bases p = Some p' /\ completes p' Ls /\ within p' p.
Proof.
  induction bases as [|[l b] bases IH]; intros j p Ls Hc Hp Hfits H.
  - exists p. repeat split; [exact Hc | apply within_refl].
  - pose proof (H O l b eq_refl) as H0. rewrite Nat.add_0_r in H0.
    destruct (keep_ok meet_1 (if l then -1 else best) b (fun c => nth j (static c) 0) p Ls Hc Hp Hfits H0) as [p1 [E1 [C1 W1]]].
    cbn [keep_static]. rewrite E1.
    destruct (IH (S j) p1 Ls C1 (within_counts _ _ W1 Hp) Hfits) as [p2 [E2 [C2 W2]]].
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

Lemma firsts_completes {B C} (p : pool (B * C)) Ls :
  completes p Ls -> completes (firsts p) (map (map fst) Ls).
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

(** * Soundness: what advice proves *)

Lemma weigh_ok ws : forall consts rows, (length ws <= length consts)%nat ->
  (forall j, (j < length consts)%nat -> 0 <= nth j consts 0 + sumZ (map (fun row => nth j row 0) rows)) ->
  0 <= weigh ws consts + sumZ (map (weigh ws) rows).
Proof.
  induction ws as [|w ws IH]; intros consts rows Hlen H.
  - simpl. rewrite sumZ_zero; [lia|]. intros row _. reflexivity.
  - destruct consts as [|x consts]; [simpl in Hlen; lia|]. simpl in Hlen.
    specialize (IH consts (map (fun row => tl row) rows) ltac:(lia)).
    pose proof (H O ltac:(simpl; lia)) as H0. cbn [nth] in H0.
    assert (E0 : sumZ (map (fun row => nth 0 row 0) rows) = sumZ (map (fun row => hd 0 row) rows)).
    { apply sumZ_ext. intros row _. destruct row; reflexivity. }
    assert (IH' : 0 <= weigh ws consts + sumZ (map (weigh ws) (map (fun row => tl row) rows))).
    { apply IH. intros j Hj. specialize (H (S j) ltac:(simpl; lia)). cbn [nth] in H. rewrite map_map.
      replace (sumZ (map (fun row => nth j (tl row) 0) rows)) with (sumZ (map (fun row => nth (S j) row 0) rows)); [exact H|].
      apply sumZ_ext. intros row _. destruct row; [destruct j|]; reflexivity. }
    assert (E : sumZ (map (weigh (w :: ws)) rows)
      = Z.max 0 w * sumZ (map (fun row => hd 0 row) rows) + sumZ (map (weigh ws) (map (fun row => tl row) rows))).
    { rewrite map_map, <- sumZ_scale, <- sumZ_add. apply sumZ_ext. intros row _. destruct row; simpl; [destruct ws; simpl|]; lia. }
    rewrite E0 in H0. rewrite E. cbn [weigh]. nia.
Qed.

Lemma by_levels_ok ls (p : pool (cand * Z * Z)) : length (by_levels ls p) = length p
  /\ Forall (way_ok meet_3 snd) (by_levels ls p).
Proof.
  assert (Hsym : forall a b, meet_3 a b = meet_3 b a) by (intros a b; apply conflict_symmetric).
  revert ls. induction p as [|nl p IH]; intros ls; [split; [reflexivity | constructor]|].
  destruct ls as [|level ls]; simpl.
  - destruct (IH []) as [H1 H2]. split; [congruence|]. constructor; [apply by_most_ok | exact H2].
  - destruct (IH ls) as [H1 H2]. split; [congruence|]. constructor; [apply by_level_ok, Hsym | exact H2].
Qed.

(** All of a joint state that fulfils the conditions is left. *)
Lemma relax_ok a seen pre profit low best bases first floor (p : pool (cand * Z)) Ls :
  let L := pre ++ concat Ls in
  let Gs := map (map (with_its_gain seen)) Ls in
  completes p Gs -> positive_counts p -> Forall cand_ok L -> seen_ok specs seen (together pre) ->
  (F pre - IZR (sum price pre) <= IZR profit)%R ->
  (F pre - IZR (sum charge pre) - IZR floor <= IZR low)%R ->
  bases_ok first bases pre -> counts first floor L -> (IZR best < profitR L)%R ->
  exists p', relax a seen (profit - best) low (statics_above best bases) p = Some p' /\ completes p' Gs /\ within p' p.
Proof.
  intros L Gs Hc Hp Hok Hseen Hprofit Hlow Hbases [Hstatic [Hfloor Hfits]] Hbest.
  unfold relax. cbv zeta. set (ls := lines_of coarse specs seen (touches a)).
  set (more := relaxed_constant specs ls). set (ws := firstn _ (shares a)).
  set (row := fun c : cand => let g := relaxed_gain coarse specs seen ls (amounts_up c) in (g - price c :: g - charge c :: static c)).
  set (number := fun cg : cand * Z => weigh ws (row (fst cg))).
  change (fun cg : cand * Z => (cg, weigh ws (relaxed_gain coarse specs seen ls (amounts_up (fst cg)) - price (fst cg)
     :: relaxed_gain coarse specs seen ls (amounts_up (fst cg)) - charge (fst cg) :: static (fst cg)))) with (fun cg => (cg, number cg)).
  set (numbered := map (fun nl : nat * list (cand * Z) => (fst nl, map (fun cg => (cg, number cg)) (snd nl))) p).
  set (Ns := map (map (fun cg => (cg, number cg))) Gs).
  assert (EN : map (map fst) Ns = Gs).
  { unfold Ns. rewrite map_map. rewrite <- (map_id Gs) at 2. apply map_ext. intros G. rewrite map_map. apply map_id. }
  assert (HN : completes numbered Ns).
  { unfold numbered, Ns. clear - Hc. clearbody Gs number. induction Hc as [|[n l] G p Gs [Hlen Hin] H IH]; simpl; constructor; [|exact IH].
    simpl in *. rewrite map_length. split; [exact Hlen|]. intros x Hx. apply in_map_iff in Hx. destruct Hx as [cg [<- Hx]].
    apply in_map_iff. exists cg. auto. }
  assert (Hpos : positive_counts numbered).
  { unfold numbered. clear - Hp. clearbody number. induction Hp; simpl; constructor; assumption. }
  destruct (by_levels_ok (levels a) numbered) as [Hlen Hways].
  assert (Hrest : fits_together (concat Ls)) by (apply (fits_app pre); exact Hfits).
  assert (Hno : Forall (no_two_meet meet_3) Ns).
  { pose proof (fits_classes Ls Hrest) as H. apply Forall_forall. intros N HN'. unfold Ns, Gs in HN'. rewrite map_map in HN'.
    apply in_map_iff in HN'. destruct HN' as [L1 [<- HL1]]. rewrite Forall_forall in H. specialize (H L1 HL1).
    rewrite map_map. unfold no_two_meet in *. clear - H. induction H as [|c L1 Hc H IH]; simpl; constructor; [|exact IH].
    rewrite Forall_map. exact Hc. }
  assert (Hsum : forall f : cand -> Z, sumZ (map f (concat Ls)) = sum f (concat Ls)) by reflexivity.
  assert (Eprice : forall f, sum f L = sum f pre + sum f (concat Ls)).
  { intros f. unfold L, sum. rewrite map_app, sumZ_app. reflexivity. }
  (* what is gained together *)
  assert (Hgain : (F L - F pre <= IZR (more + sumZ (map (fun c => relaxed_gain coarse specs seen ls (amounts_up c)) (concat Ls))))%R).
  { apply Forall_app in Hok. destruct Hok as [Hpre Hrest_ok]. rewrite Forall_forall in Hrest_ok.
    pose proof (relaxed_ok amount_unit weight_unit precision coarse amount_unit_pos weight_unit_pos precision_pos coarse_pos
      specs specs_all_ok seen (touches a) (together pre) (map amounts (concat Ls)) Hseen (fun j => together_nonneg pre j Hpre)) as HR.
    fold ls more in HR. rewrite !map_map in HR.
    assert (Eup : sumZ (map (fun c => relaxed_gain coarse specs seen ls (map coarse_up (amounts c))) (concat Ls))
        = sumZ (map (fun c => relaxed_gain coarse specs seen ls (amounts_up c)) (concat Ls))).
    { apply sumZ_ext. intros c Hc'. destruct (Hrest_ok c Hc') as [_ [_ <-]]. reflexivity. }
    rewrite Eup in HR. unfold F.
    rewrite (worth_ext specs (together L) (fun j => together pre j + sumZ (map (fun cs => nth j cs 0) (map amounts (concat Ls))))%Z).
    - apply HR. intros cs Hcs. apply in_map_iff in Hcs. destruct Hcs as [c [<- Hc']]. destruct (Hrest_ok c Hc') as [H1 [H2 _]]. auto.
    - intros j. unfold L. rewrite together_app. f_equal. unfold together. rewrite map_map. reflexivity. }
  assert (Hconditions : -1 < weigh ws (profit - best + more :: low + more :: statics_above best bases) + sumZ (map snd (concat Ns))).
  { assert (ES : sumZ (map snd (concat Ns)) = sumZ (map (weigh ws) (map row (concat Ls)))).
    { unfold Ns, Gs. rewrite !concat_map_map, !map_map. reflexivity. }
    rewrite ES. enough (0 <= weigh ws (profit - best + more :: low + more :: statics_above best bases) + sumZ (map (weigh ws) (map row (concat Ls)))) by lia.
    assert (Estatics : length (statics_above best bases) = length bases) by apply map_length.
    assert (Hgains : forall f : cand -> Z, sumZ (map (fun c => relaxed_gain coarse specs seen ls (amounts_up c) - f c) (concat Ls))
       = sumZ (map (fun c => relaxed_gain coarse specs seen ls (amounts_up c)) (concat Ls)) - sum f (concat Ls)).
    { intros f. unfold sum. clear. induction (concat Ls) as [|c l IH]; [reflexivity|]. cbn [map sumZ]. rewrite IH. lia. }
    apply weigh_ok.
    - unfold ws. rewrite firstn_length. cbn [length]. lia.
    - intros j Hj. rewrite map_map. destruct j as [|[|j]]; cbn [nth row].
      + rewrite Hgains. apply Z.lt_le_incl, lt_IZR. unfold profitR in Hbest. rewrite (Eprice price) in Hbest.
        rewrite ?plus_IZR, ?minus_IZR in *. lra.
      + rewrite Hgains. apply le_IZR. rewrite (Eprice charge) in Hfloor. rewrite ?plus_IZR, ?minus_IZR in *. lra.
      + cbn [length] in Hj. rewrite Estatics in Hj. unfold statics_above.
        destruct (nth_error bases j) as [[il b]|] eqn:Ej; [|apply nth_error_None in Ej; lia].
        pose proof (Hbases j) as Hj'. rewrite Ej in Hj'.
        destruct (nth_error first j) as [[il' b']|] eqn:Ef; [|discriminate Hj']. injection Hj' as -> ->.
        rewrite (nth_error_nth (map _ bases) j 0 (map_nth_error _ _ _ Ej)). cbn [fst snd].
        specialize (Hstatic j il' b' Ef).
        assert (Es : static_sum j L = static_sum j pre + static_sum j (concat Ls)).
        { unfold static_sum, L. rewrite map_app, sumZ_app. reflexivity. }
        change (sumZ (map (fun c => nth j (static c) 0) (concat Ls))) with (static_sum j (concat Ls)).
        destruct il'.
        * lia.
        * enough (best < b' + static_sum j L) by lia. apply lt_IZR. lra. }
  destruct (keep_by_ok meet_3 (by_levels (levels a) numbered) (-1) (weigh ws (profit - best + more :: low + more :: statics_above best bases))
     snd numbered Ns HN Hpos Hlen Hways Hno Hconditions) as [kept [Ek [Ck Wk]]].
  rewrite Ek. exists (firsts kept). split; [reflexivity|]. split.
  - pose proof (firsts_completes kept Ns Ck) as H. rewrite EN in H. exact H.
  - unfold numbered in Wk. clear - Wk. clearbody number. revert kept Wk. induction p as [|[n l] p IH]; intros kept Wk; inversion Wk as [|[n' l'] ? kept' ? [E Hin] Wk']; subst; simpl; constructor.
    + simpl in *. split; [exact E|]. intros x Hx. apply in_map_iff in Hx. destruct Hx as [y [<- Hy]].
      apply Hin in Hy. apply in_map_iff in Hy. destruct Hy as [z [<- Hz]]. exact Hz.
    + apply IH, Wk'.
Qed.

Lemma advised_ok times : forall seen pre profit low best bases first floor (p : pool (cand * Z)) Ls mind,
  let L := pre ++ concat Ls in
  let Gs := map (map (with_its_gain seen)) Ls in
  completes p Gs -> positive_counts p -> Forall cand_ok L -> seen_ok specs seen (together pre) ->
  (F pre - IZR (sum price pre) <= IZR profit)%R ->
  (F pre - IZR (sum charge pre) - IZR floor <= IZR low)%R ->
  bases_ok first bases pre -> counts first floor L -> (IZR best < profitR L)%R ->
  exists p' mind', advised times seen (profit - best) low (statics_above best bases) p mind = (Some p', mind')
    /\ completes p' Gs /\ within p' p.
Proof.
  induction times as [|times IH]; intros seen pre profit low best bases first floor p Ls mind L Gs Hc Hp Hok Hseen Hprofit Hlow Hbases Hcounts Hbest.
  - exists p, mind. repeat split; [exact Hc | apply within_refl].
  - cbn [advised]. destruct (advise _ _ _ _) as [[a|] mind']; [|exists p, mind'; repeat split; [exact Hc | apply within_refl]].
    destruct (relax_ok a seen pre profit low best bases first floor p Ls Hc Hp Hok Hseen Hprofit Hlow Hbases Hcounts Hbest) as [p1 [E1 [C1 W1]]].
    rewrite E1.
    destruct (IH seen pre profit low best bases first floor p1 Ls mind' C1 (within_counts _ _ W1 Hp) Hok Hseen Hprofit Hlow Hbases Hcounts Hbest)
      as [p2 [mind2 [E2 [C2 W2]]]].
    exists p2, mind2. repeat split; [exact E2 | exact C2 | eapply within_trans; eassumption].
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

Lemma node_keeps L fuel : forall chosen seen profit low bases p mind a, Good L a ->
  Good L (node fuel chosen seen profit low bases p mind a).
Proof.
  induction fuel as [|fuel IH]; intros chosen seen profit low bases p mind a H; destruct p as [|q p]; cbn [node]; try (apply Good_keep, H); try exact H.
  cbv zeta.
  destruct (keep_static _ _ _ _) as [p1|]; [|exact H]. destruct (keep _ _ _ _) as [p2|]; [|exact H].
  destruct (keep _ _ _ _) as [p3|]; [|exact H].
  destruct (advised _ _ _ _ _ _ _) as [[[|[n l] others]|] mind']; try exact H.
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
Theorem node_ok fuel : forall pre seen profit low bases p mind a Ls,
  completes p Ls -> positive_counts p -> (drones_left p <= fuel)%nat ->
  (singles = true -> Forall (fun nl => fst nl = 1%nat) p) ->
  Forall cand_ok (pre ++ concat Ls) -> seen_ok specs seen (together pre) ->
  (F pre - IZR (sum price pre) <= IZR profit)%R ->
  (F pre - IZR (sum charge pre) - IZR floor <= IZR low)%R ->
  bases_ok first bases pre -> counts first floor (pre ++ concat Ls) ->
  Good (pre ++ concat Ls) (node fuel (rev pre) seen profit low bases p mind a).
Proof.
  induction fuel as [|fuel IH]; intros pre seen profit low bases p mind a Ls Hc Hp Hfuel Hsingle Hok Hseen Hprofit Hlow Hbases Hcounts.
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
    pose proof Hcounts as Hall_counts. destruct Hcounts as [Hstatic [Hfloor Hfits]].
    pose proof (fits_classes Ls (proj2 (fits_app pre _ Hfits))) as Hclasses.
    (* the static bounds *)
    destruct (keep_static_ok (threshold a) bases 0 p Ls Hc Hp Hclasses) as [p1 [E1 [C1 W1]]].
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
    assert (HclassesG : Forall (no_two_meet meet_2) Gs).
    { apply Forall_forall. intros G HG. unfold Gs in HG. apply in_map_iff in HG. destruct HG as [L1 [<- HL1]].
      rewrite Forall_forall in Hclasses. specialize (Hclasses L1 HL1). clear - Hclasses. unfold no_two_meet in *.
      induction Hclasses as [|c l Hc' H IHl]; simpl; constructor; [|exact IHl]. rewrite Forall_map. exact Hc'. }
    (* profits *)
    destruct (keep_ok meet_2 (threshold a) profit profit_gain (with_gain seen p1) Gs CG (with_gain_counts seen p1 P1) HclassesG) as [p2 [E2 [C2 W2]]].
    { unfold profit_gain. rewrite (Esums price). apply lt_IZR. rewrite plus_IZR, minus_IZR.
      unfold profitR in Hgt. rewrite Eprice, plus_IZR in Hgt. lra. }
    pose proof (within_counts _ _ W2 (with_gain_counts seen p1 P1)) as P2.
    (* worth less charges *)
    destruct (keep_ok meet_2 (-1) low low_gain p2 Gs C2 P2 HclassesG) as [p3 [E3 [C3 W3]]].
    { unfold low_gain. rewrite (Esums charge). apply lt_IZR. rewrite plus_IZR, minus_IZR.
      rewrite Echarge, plus_IZR in Hfloor. lra. }
    pose proof (within_counts _ _ W3 P2) as P3.
    unfold p in E1 |- *. cbn [node]. cbv zeta. rewrite E1, E2, E3. fold p.
    (* what advice proves *)
    destruct (advised_ok most_advice seen pre profit low (threshold a) bases first floor p3 Ls mind C3 P3 Hok Hseen Hprofit Hlow Hbases Hall_counts Hgt)
      as [p4 [mind' [E4 [C4 W4]]]].
    pose proof (within_counts _ _ W4 P3) as P4. rewrite E4. fold Gs in C4.
    assert (W34 : within p4 p2) by (eapply within_trans; eassumption).
    clear C3 W3 P3 E4 W4. rename C4 into C3, W34 into W3, P4 into P3, p3 into p3', p4 into p3.
    destruct p3 as [|[n l] others].
    { inversion C3 as [EG|]. exfalso. unfold Gs in *. destruct Ls; [inversion Hc | discriminate]. }
    destruct Gs as [|G1 Gs'] eqn:EGs; [inversion C3|].
    destruct Ls as [|L1 Ls']; [discriminate|]. injection EGs as EG1 EGs'.
    apply Forall2_head in C3. destruct C3 as [[HlenG HinG] C3]. simpl in HlenG, HinG.
    apply Forall_cons_iff in P3. destruct P3 as [Hn P3]. simpl in Hn.
    apply Forall_cons_iff in HclassesG. destruct HclassesG as [_ HclassesG].
    destruct (mosts_ok meet_2 profit_gain others Gs' C3 P3 HclassesG) as [ms [Ems Hmost]].
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
    pose proof (firsts_completes others Gs' C3) as Cplain. rewrite ELs in Cplain.
    assert (Pplain : positive_counts (firsts others)).
    { clear - P3. induction P3; simpl; constructor; assumption. }
    assert (Lplain : drones_left (firsts others) = drones_left others).
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
          (low + g - charge c) (add_static bases (static c)) (after c (pred n) here (firsts others)) mind' found) c0 g0 here a0)).
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
      destruct (after_completes c (pred n) (c :: map (fun x => fst (fst x)) items) (firsts others)
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
          (after c (pred n) (c :: map (fun x => fst (fst x)) items) (firsts others)) mind' a)).
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
          (after c (pred n) (c :: map (fun x => fst (fst x)) items) (firsts others)) mind' a)))) as [Hle | Hgt'].
      * apply each_keeps; [exact Hrec | apply Good_low, Hle].
      * apply Rnot_le_lt in Hgt'. apply IHi; [exact Hgt'|].
        exists (map fst items). split.
        -- symmetry. symmetry. apply (most_after_tail profit_gain l' (c, g, m)). symmetry. exact Eitems.
        -- intros x Hx. specialize (Hincl x Hx). simpl in Hincl. destruct Hincl as [E | Hx']; [|exact Hx'].
           exfalso. apply Hcout. rewrite E. exact Hx.
Qed.
End Search.
