(** Staged certificates: the plans above a target, narrowed down.

    No plan above the target visits a closed state, and at each step its worth is between the bounds
    that are kept of the step.  docs/concepts/step-envelopes.md has the inequalities in words. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz Permutation FMapPositive Sorting.Mergesort Orders.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker Gains Pools Search.
Import ListNotations.
Open Scope Z_scope.

(** Of each class, a number for each state. *)
Definition by_state : Type := list (nat * PM.t Z).
Definition map_of (b : by_state) (k : nat) : PM.t Z := of_class (PM.empty Z) b k.
Definition number_of (b : by_state) (k : nat) (s : state) : Z :=
  match PM.find s (map_of b k) with Some v => v | None => 0 end.

(** What joint states are worth at a step is at most a constant and the prices of their states. *)
Record upper := Upper { u_constant : Z; u_prices : by_state }.

(** A step: the bound of now, whose prices are of the states that are left; earlier ones; and what
    joint states are worth at least: a floor and what their states are charged. *)
Record step := Step { now : upper; earlier : list upper; floor : Z; charges : by_state }.
Definition no_step : step := Step (Upper 0 []) [] 0 [].

Record stage := Stage {
  payments : list (nat * nat * (list (state * Z) * Z));  (* step, class, prices of states, others' rise *)
  step_constants : list (nat * Z) }.                     (* step, a constant, tried in this order *)

(** Class and place; the place a step before, where it matters, and the state. *)
Definition named : Type := (nat * positive) * (positive * state).
Notation candidate := (cand named).

(** Candidates of most profit first: an order, and nothing more. *)
Module ByProfit <: TotalLeBool.
  Definition t : Type := candidate * Z.
  Definition leb (a b : t) : bool := profit_gain named b <=? profit_gain named a.
  Lemma leb_total a b : leb a b = true \/ leb b a = true.
  Proof. unfold leb. destruct (Z.leb_spec (profit_gain named b) (profit_gain named a)); [auto|]. right. apply Z.leb_le. lia. Qed.
End ByProfit.
Module Sorted := Sort ByProfit.

Section Staged.
Variables (I : instance) (C : certificate) (coarse : Z).

(** Who gives advice at a node of a search, and what it thinks at first. *)
Variable memory : Type.
Variable advise : list spec -> so_far_of -> list Z -> pool (candidate * Z) -> memory -> option advice * memory.
Variable mind : memory.

Notation T := (horizon I).
Notation M := (numbers C).
Notation rs := (all_rows C []).

Definition build_map {B} (f : state -> B -> option Z) (m : PM.t B) : PM.t Z :=
  fold_left (fun acc sv => match f (fst sv) (snd sv) with Some v => PM.add (fst sv) v acc | None => acc end)
            (PM.elements m) (PM.empty Z).

(** * Sweeps over the states that are left *)

Definition narrowing := list step.
Definition at_ (N : narrowing) (t : nat) : step := nth t N no_step.

Definition is_left (N : narrowing) (k t : nat) : state -> bool :=
  let m := map_of (u_prices (now (at_ N t))) k in
  fun s => match PM.find s m with Some _ => true | None => false end.

Definition step_price (N : narrowing) (k t : nat) : state -> Z :=
  let prices := u_prices (now (at_ N t)) in
  fun s => number_of prices k s - charge_here I rs k t s.

Definition toll' (k t : nat) : state -> state -> Z := toll I C [] k t.

Definition left_forward (N : narrowing) (k : nat) (price : nat -> state -> Z) (toll : nat -> state -> state -> Z)
  (starts : list (list state * Z)) : list (PM.t Z) :=
  forward (moves I k) (is_left N k) price toll T 0
    (fold_left (fun m sv => fold_left (fun m s => if is_left N k 0 s then lift s (snd sv) m else m) (fst sv) m)
               starts (PM.empty Z)).

Definition starts_in (k : nat) : list (list state) :=
  map snd (filter (fun d => Nat.eqb k (fst d)) (team I)).

Definition to_go_of (N : narrowing) (k : nat) : list (PM.t (option Z)) :=
  backward (moves I k) (step_price N k) (toll' k) 0
    (left_forward N k (fun _ _ => 0) (fun _ _ _ => 0) (map (fun l => (l, 0)) (starts_in k))).

Definition first_of {B} (l : list (PM.t B)) : PM.t B := match l with [] => PM.empty B | m :: _ => m end.

(** What the drones of a class get at most, each beside its starts. *)
Definition bests_of (Vs : list (PM.t (option Z))) (k : nat) : list (list state * Z) :=
  map (fun starts => (starts, match best_start (first_of Vs) starts with Some b => b | None => 0 end)) (starts_in k).

Definition total_constant (N : narrowing) : Z := sumZ (map (fun st => u_constant (now st)) N).

(** The bound on plans that visit only states that are left; None: there are none. *)
Definition left_bound (N : narrowing) (Vs : list (nat * list (PM.t (option Z)))) : option Z :=
  match team_best (fun k => first_of (of_class [] Vs k)) (team I) with
  | None => None
  | Some v => Some (total_constant N + row_constant C [] + v)
  end.

Definition sweep_all (N : narrowing) : list (nat * list (PM.t (option Z))) :=
  map (fun k => (k, to_go_of N k)) (classes I).

(** Closes states of so much slack that no plan above the target visits them. *)
Definition closed_step (target bound : Z) (so_far : list (nat * list (PM.t Z))) (Vs : list (nat * list (PM.t (option Z))))
  (t : nat) (st : step) : step :=
  let slack k := let V := nth t (of_class [] Vs k) (PM.empty _) in
                 fun s u => match PM.find s V with Some (Some v) => Some (- (u + v)) | _ => None end in
  let of_left (f : nat -> state -> Z -> Z) :=
    map (fun k => (k, build_map (fun s u => match slack k s u with
                                  | Some l => if l <=? bound - target then Some (f k s l) else None
                                  | None => None end) (nth t (of_class [] so_far k) (PM.empty Z)))) (classes I) in
  let prices := u_prices (now st) in
  Step (Upper (u_constant (now st)) (of_left (fun k s _ => number_of prices k s))) (earlier st)
       (target - bound + u_constant (now st)) (of_left (fun k s l => number_of prices k s + l)).

Fixpoint with_steps {B} (f : nat -> B -> B) (t : nat) (l : list B) : list B :=
  match l with [] => [] | b :: rest => f t b :: with_steps f (S t) rest end.

(** None: no plan is above the target. *)
Definition close (target : Z) (N : narrowing) : option narrowing :=
  let Vs := sweep_all N in
  match left_bound N Vs with
  | None => None
  | Some bound =>
      let so_far := map (fun k => (k, left_forward N k (step_price N k) (toll' k)
                           (map (fun sv => (fst sv, - snd sv)) (bests_of (of_class [] Vs k) k)))) (classes I) in
      Some (with_steps (closed_step target bound so_far Vs) 0 N)
  end.

(** * The search of a step *)

Definition step_groups (t : nat) : list group :=
  filter (fun g => Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) (groups I).

Definition specs_of (gs : list group) : list spec :=
  map (fun g => spec_of (weight_unit I) (precision M) coarse (weight I g) (return_by I g)) gs.

Definition places_meet (a : named) : named -> bool :=
  let x := fst a in let meet_x := meet I x in
  fun b => let y := fst b in meet_x y && meet I y x.

Definition candidate_of (gs : list group) (t k : nat) (n : named) (price charge : Z) (static : list Z) (s : state) : candidate :=
  let zs := map (fun g => amount I g k t s) gs in
  Cand named n zs (map (coarse_up (amount_unit I) coarse) zs) price charge static.

(** The worth of amounts, in 1/precision, rounded up: the exact one. *)
Definition exact_return (w : Z) (r : return_of) (z : Z) : Z :=
  match r with
  | Root => cdiv (precision M * (w * root_of I M z)) (weight_unit I * scale M)
  | AtMost k => cdiv (precision M * (w * Z.min z (k * amount_unit I))) (weight_unit I * amount_unit I)
  end.

Fixpoint add_all (l : list (list Z)) (n : nat) : list Z :=
  match n with
  | O => []
  | S n' => sumZ (map (fun zs => hd 0 zs) l) :: add_all (map (fun zs => tl zs) l) n'
  end.

Fixpoint exact_worth (gs : list group) (zs : list Z) : Z :=
  match gs, zs with
  | g :: gs', z :: zs' => exact_return (weight I g) (return_by I g) z + exact_worth gs' zs'
  | _, _ => 0
  end.

Definition exact_of (gs : list group) (l : list candidate) : Z :=
  exact_worth gs (add_all (map (amounts named) l) (length gs)).

Definition highest (gs : list group) (floor : Z) (l : list candidate) (best : Z) : Z :=
  let worth := exact_of gs l in
  if floor + sum named (charge named) l <=? worth then Z.max best (worth - sum named (price named) l) else best.

(** New prices of the states that are left at a step. *)
Definition repriced (st : step) (t : nat) (stg : stage) : by_state :=
  map (fun k =>
    let old := map_of (u_prices (now st)) k in
    (k, match find (fun e => Nat.eqb t (fst (fst e)) && Nat.eqb k (snd (fst e))) (payments stg) with
        | None => old
        | Some (_, (listed, others)) =>
            let table := fold_left (fun m sv => PM.add (fst sv) (snd sv) m) listed (PM.empty Z) in
            PM.mapi (fun s v => match PM.find s table with Some p => p | None => v + others end) old
        end)) (classes I).

Definition step_bases (st : step) : list base :=
  (true, u_constant (now st) - floor st) :: map (fun u => (false, u_constant u)) (now st :: earlier st).

Definition step_static (st : step) (k : nat) (s : state) (price : Z) : list Z :=
  (number_of (u_prices (now st)) k s - number_of (charges st) k s)
  :: map (fun u => number_of (u_prices u) k s - price) (now st :: earlier st).

Definition here (k : nat) (s : state) : named := let p := place I k s in ((k, p), (p, s)).

Definition step_candidate (st : step) (gs : list group) (t k : nat) (s : state) (price : Z) : candidate :=
  candidate_of gs t k (here k s) price (number_of (charges st) k s) (step_static st k s price) s.

Definition search {A : Type} (threshold : A -> Z) (take_down : list candidate -> A -> A)
    (conflict : named -> named -> bool) (gs : list group) :=
  node named conflict coarse (specs_of gs) A threshold take_down Sorted.sort memory (advise (specs_of gs)).

(** The most that a joint state is worth at new prices, or the constant that is claimed. *)
Definition most_profit (st : step) (t : nat) (prices : by_state) (claim : Z) : Z :=
  let gs := step_groups t in
  search (fun best => best) (highest gs (floor st)) places_meet gs (length (team I)) []
    (nothing (specs_of gs)) 0 (- floor st) (step_bases st)
    (map (fun k => (size I k, map (fun sv => step_candidate st gs t k (fst sv) (snd sv))
                                  (PM.elements (map_of prices k)))) (classes I)) mind claim.

Definition after_constant (stg : stage) (t : nat) (claim : Z) (st : step) : step :=
  let prices := repriced st t stg in
  Step (Upper (most_profit st t prices claim) prices) (now st :: earlier st) (floor st) (charges st).

Fixpoint change {B} (t : nat) (f : B -> B) (l : list B) : list B :=
  match l, t with
  | [], _ => []
  | b :: rest, O => f b :: rest
  | b :: rest, S t' => b :: change t' f rest
  end.

Definition after_stage (stg : stage) (N : narrowing) : narrowing :=
  fold_left (fun N tc => change (fst tc) (after_constant stg (fst tc) (snd tc)) N) (step_constants stg) N.

(** States are closed, and once more with the bound of those that are left. *)
Definition close_twice (target : Z) (N : narrowing) : option narrowing :=
  match close target N with None => None | Some N' => close target N' end.

Fixpoint after_stages (target : Z) (stages : list stage) (N : narrowing) : option narrowing :=
  match stages with
  | [] => Some N
  | stg :: rest =>
      match close_twice target (after_stage stg N) with
      | None => None
      | Some N' => after_stages target rest N'
      end
  end.

Definition first_narrowing : narrowing :=
  let reach := map (fun k => (k, in_reach I k)) (classes I) in
  map (fun t => Step (Upper (step_constant I M t)
      (map (fun k => (k, PM.mapi (fun s _ => paid I M k t s) (nth t (of_class [] reach k) (PM.empty Z)))) (classes I)))
      [] 0 []) (seq 0 (S T)).

Definition staged_numbers_ok : bool :=
  numbers_ok I C [] && negb (over_time M) && (0 <? coarse)
  && forallb (fun k => views_in_reach_ok I C k 0 (in_reach I k)) (classes I).

(** The narrowing after all stages; None: no plan is above the target. *)
Definition narrowed (target : Z) (stages : list stage) : option narrowing :=
  match close_twice target first_narrowing with
  | None => None
  | Some N => after_stages target stages N
  end.

(** What no plan is above, in 1/precision; None: the certificate proves nothing. *)
Definition staged_bound (target : Z) (stages : list stage) : option Z :=
  if staged_numbers_ok then
    Some (match narrowed target stages with
          | None => target
          | Some N => match left_bound N (sweep_all N) with
                      | None => target
                      | Some b => Z.max target b
                      end
          end)
  else None.

(** * Soundness *)

Lemma find_build_map {B} (f : state -> B -> option Z) (m : PM.t B) s u v :
  PM.find s m = Some u -> f s u = Some v -> PM.find s (build_map f m) = Some v.
Proof.
  intros Hs Hf. unfold build_map.
  assert (Huniq : forall sv, In sv (PM.elements m) -> fst sv = s -> snd sv = u).
  { intros [s' u'] Hin E. simpl in *. subst s'. apply PM.elements_complete in Hin. congruence. }
  apply PM.elements_correct in Hs. revert Huniq Hs. generalize (PM.elements m) as l.
  assert (Hold : forall l acc, (forall sv, In sv l -> fst sv = s -> snd sv = u) -> PM.find s acc = Some v ->
    PM.find s (fold_left (fun acc (sv : state * B) => match f (fst sv) (snd sv) with Some v => PM.add (fst sv) v acc | None => acc end) l acc) = Some v).
  { induction l as [|[s' u'] l IH]; intros acc Hu Ha; simpl; [exact Ha|]. apply IH; [intros; apply Hu; [right|]; assumption|].
    destruct (f s' u') as [v'|] eqn:E; [|exact Ha]. destruct (Pos.eq_dec s s') as [<- | Hne].
    - rewrite PM.gss. pose proof (Hu (s, u') (or_introl eq_refl) eq_refl) as E'. simpl in E'. subst u'. congruence.
    - rewrite PM.gso by exact Hne. exact Ha. }
  intros l. generalize (PM.empty Z). induction l as [|[s' u'] l IH]; intros acc Hu Hin; [contradiction|]. simpl.
  destruct Hin as [E | Hin].
  - injection E as -> ->. apply Hold; [intros; apply Hu; [right|]; assumption|]. rewrite Hf. apply PM.gss.
  - apply IH; [intros; apply Hu; [right|]; assumption | exact Hin].
Qed.

Lemma Forall2_seq_nth {B} (P : B -> nat -> Prop) (d : B) n : forall l t, Forall2 P l (seq t n) ->
  forall j, (j < n)%nat -> P (nth j l d) (t + j)%nat.
Proof.
  induction n as [|n IH]; intros l t H j Hj; [lia|]. destruct l as [|b l]; [inversion H|].
  simpl seq in H. apply Forall2_head in H. destruct H as [Hb H]. destruct j as [|j]; simpl.
  - rewrite Nat.add_0_r. exact Hb.
  - replace (t + S j)%nat with (S t + j)%nat by lia. apply (IH l (S t) H). lia.
Qed.

Lemma with_steps_nth {B} (f : nat -> B -> B) (d : B) : forall l t j, (j < length l)%nat ->
  nth j (with_steps f t l) d = f (t + j)%nat (nth j l d).
Proof.
  induction l as [|b l IH]; intros t j Hj; simpl in *; [lia|]. destruct j as [|j].
  - rewrite Nat.add_0_r. reflexivity.
  - rewrite (IH (S t) j) by lia. f_equal. lia.
Qed.

Lemma with_steps_length {B} (f : nat -> B -> B) l : forall t, length (with_steps f t l) = length l.
Proof. induction l; intros t; simpl; congruence. Qed.

Lemma change_nth {B} (f : B -> B) (d : B) : forall l t j, (j < length l)%nat ->
  nth j (change t f l) d = if Nat.eqb j t then f (nth j l d) else nth j l d.
Proof.
  induction l as [|b l IH]; intros t j Hj; simpl in *; [lia|]. destruct t as [|t], j as [|j]; simpl; try reflexivity.
  apply IH. lia.
Qed.

Lemma change_length {B} (f : B -> B) : forall l t, length (change t f l) = length l.
Proof. induction l; intros [|t]; simpl; congruence. Qed.

Lemma map_of_map (f : nat -> PM.t Z) k : In k (classes I) -> map_of (map (fun k => (k, f k)) (classes I)) k = f k.
Proof. apply of_class_map. Qed.

Lemma sum_nth {B} (f : B -> Z) (d : B) l : sumZ (map f l) = total (length l) (fun t => f (nth t l d)).
Proof.
  rewrite total_seq. f_equal. induction l as [|b l IH]; [reflexivity|].
  simpl. f_equal. rewrite IH, <- seq_shift, map_map. reflexivity.
Qed.

(** * Soundness of a search's parts *)

Lemma places_meet_symmetric a b : places_meet a b = places_meet b a.
Proof. unfold places_meet. cbv zeta. apply andb_comm. Qed.

Lemma named_dec (a b : named) : {a = b} + {a <> b}.
Proof. unfold named in *. repeat decide equality. Qed.

Lemma sorted_permutes l : Permutation (Sorted.sort l) l.
Proof. apply Permutation_sym, Sorted.Permuted_sort. Qed.

Section Parts.
Hypothesis fine : units_ok I M = true.

Lemma exact_return_ok w r z : 0 <= w -> 0 <= z ->
  (IZR (precision M) * (IZR w / IZR (weight_unit I) * return_value r (IZR z / IZR (amount_unit I)))
   <= IZR (exact_return w r z))%R.
Proof.
  intros Hw Hz. destruct (units I M fine) as [Zs [Zu [Za Zw]]].
  pose proof (IZR_pos _ Zs) as Ps. pose proof (IZR_pos _ Zu) as Pu. pose proof (IZR_pos _ Za) as Pa. pose proof (IZR_pos _ Zw) as Pw.
  pose proof (IZR_nonneg _ Hw) as Hw'.
  assert (HW : (0 <= IZR (precision M) * IZR w / IZR (weight_unit I))%R).
  { apply Rmult_le_pos; [apply Rmult_le_pos; lra | apply Rlt_le, Rinv_0_lt_compat, Pw]. }
  destruct r as [|k]; simpl.
  - eapply Rle_trans; [|apply cdiv_R; nia]. rewrite !mult_IZR.
    destruct (root_of_ok I M fine z Hz) as [_ H].
    apply (Rmult_le_compat_l _ _ _ HW) in H.
    apply Rmult_le_reg_r with (IZR (scale M)); [exact Ps|].
    replace (IZR (precision M) * (IZR w * IZR (root_of I M z)) / (IZR (weight_unit I) * IZR (scale M)) * IZR (scale M))%R
      with (IZR (precision M) * IZR w / IZR (weight_unit I) * IZR (root_of I M z))%R by (field; lra).
    eapply Rle_trans; [|exact H]. apply Req_le. field. lra.
  - eapply Rle_trans; [|apply cdiv_R; nia]. rewrite !mult_IZR.
    assert (E : (Rmin (IZR z / IZR (amount_unit I)) (IZR k) <= IZR (Z.min z (k * amount_unit I)) / IZR (amount_unit I))%R).
    { apply Rmult_le_reg_r with (IZR (amount_unit I)); [exact Pa|].
      unfold Rdiv at 2. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
      unfold Rmin. destruct (Rle_dec (IZR z / IZR (amount_unit I)) (IZR k)) as [L | L].
      - apply (Rmult_le_compat_r (IZR (amount_unit I))) in L; [|lra].
        unfold Rdiv in *. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in * by lra.
        rewrite <- mult_IZR in L. apply le_IZR in L. apply IZR_le. lia.
      - apply Rnot_le_lt in L. apply (Rmult_lt_compat_r (IZR (amount_unit I))) in L; [|lra].
        unfold Rdiv in L. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in L by lra.
        rewrite <- mult_IZR in *. apply lt_IZR in L. apply IZR_le. lia. }
    apply (Rmult_le_compat_l _ _ _ HW) in E. eapply Rle_trans; [eapply Rle_trans; [|exact E]|]; apply Req_le; field; repeat split; lra.
Qed.

Definition gs_ok (gs : list group) : Prop := forall g, In g gs -> 0 <= weight I g /\ is_return (return_by I g).

Lemma specs_of_ok gs : gs_ok gs -> forall s, In s (specs_of gs) ->
  exists w r, s = spec_of (weight_unit I) (precision M) coarse w r /\ 0 <= w /\ is_return r.
Proof.
  intros H s Hs. apply in_map_iff in Hs. destruct Hs as [g [<- Hg]]. destruct (H g Hg).
  exists (weight I g), (return_by I g). auto.
Qed.

Lemma exact_worth_ok gs : gs_ok gs -> forall ls, (forall zs, In zs ls -> Forall (fun z => 0 <= z) zs) ->
  (worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth j zs 0%Z) ls))
   <= IZR (exact_worth gs (add_all ls (length gs))))%R.
Proof.
  induction gs as [|g gs IH]; intros Hg ls Hls; simpl; [lra|].
  rewrite plus_IZR. apply Rplus_le_compat.
  - replace (sumZ (map (fun zs => nth 0 zs 0) ls)) with (sumZ (map (fun zs => hd 0 zs) ls)).
    2:{ apply sumZ_ext. intros zs _. destruct zs; reflexivity. }
    apply exact_return_ok; [exact (proj1 (Hg g (or_introl eq_refl)))|]. apply sumZ_nonneg. intros zs Hzs. specialize (Hls zs Hzs).
    destruct Hls; simpl; lia.
  - assert (E : worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth (S j) zs 0) ls))
       = worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun zs => nth j zs 0) (map (fun zs => tl zs) ls)))).
    { apply worth_ext. intros j. rewrite map_map. apply sumZ_ext. intros zs _. destruct zs; [destruct j|]; reflexivity. }
    rewrite E. apply IH; [intros g' Hg'; exact (Hg g' (or_intror Hg'))|].
    intros zs Hzs. apply in_map_iff in Hzs. destruct Hzs as [zs' [<- Hzs']]. specialize (Hls zs' Hzs').
    destruct Hls; simpl; [constructor | assumption].
Qed.

Notation all_ok gs := (Forall (cand_ok named (amount_unit I) coarse (specs_of gs))).
Notation worth_in gs := (F named (amount_unit I) (weight_unit I) (precision M) (specs_of gs)).

Lemma exact_of_ok gs l : gs_ok gs -> all_ok gs l -> (worth_in gs l <= IZR (exact_of gs l))%R.
Proof.
  intros Hg Hl. unfold F, exact_of.
  eapply Rle_trans; [|apply (exact_worth_ok gs Hg)].
  - apply Req_le, worth_ext. intros j. unfold together. rewrite map_map. reflexivity.
  - intros zs Hzs. apply in_map_iff in Hzs. destruct Hzs as [c [<- Hc]]. rewrite Forall_forall in Hl.
    destruct (Hl c Hc) as [_ [H _]]. exact H.
Qed.

(** What candidates see together is worth what their groups are. *)
Lemma worth_of_groups {B} gs (a : group -> B -> Z) (l : list B) :
  (worthR (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (fun j => sumZ (map (fun b => nth j (map (fun g => a g b) gs) 0%Z) l))
   = sumR (map (fun g => IZR (precision M) * worth I g (sumZ (map (a g) l))) gs))%R.
Proof.
  induction gs as [|g gs IH]; simpl; [reflexivity|]. f_equal. exact IH.
Qed.
End Parts.

(** ** The drones of a plan, class by class *)

Lemma by_class_permutes {B} (class : B -> nat) (ks : list nat) (l : list B) : NoDup ks -> (forall b, In b l -> In (class b) ks) ->
  Permutation (concat (map (fun k => filter (fun b => Nat.eqb k (class b)) l) ks)) l.
Proof.
  intros Hk. induction l as [|b l IH]; intros Hin.
  - clear. induction ks; simpl; [constructor | assumption].
  - assert (Hb : In (class b) ks) by (apply Hin; left; reflexivity).
    destruct (in_split _ _ Hb) as [k1 [k2 Ek]].
    assert (Hnot : ~ In (class b) (k1 ++ k2)) by (rewrite Ek in Hk; apply NoDup_remove_2 in Hk; exact Hk).
    assert (Hother : forall k, In k (k1 ++ k2) -> filter (fun b' => Nat.eqb k (class b')) (b :: l) = filter (fun b' => Nat.eqb k (class b')) l).
    { intros k Hk'. simpl. destruct (Nat.eqb_spec k (class b)); [subst; contradiction | reflexivity]. }
    specialize (IH (fun b' Hb' => Hin b' (or_intror Hb'))). rewrite Ek in IH |- *. rewrite !map_app, !concat_app in *. simpl in *.
    rewrite Nat.eqb_refl.
    rewrite (map_ext_in _ (fun k => filter (fun b' => Nat.eqb k (class b')) l) k1) by (intros k Hk'; apply Hother, in_app_iff; auto).
    rewrite (map_ext_in _ (fun k => filter (fun b' => Nat.eqb k (class b')) l) k2) by (intros k Hk'; apply Hother, in_app_iff; auto).
    simpl. rewrite <- Permutation_middle. constructor. exact IH.
Qed.

Section Plan.
Variable plan : list flight.
Hypothesis ok : staged_numbers_ok = true.
Hypothesis planned : is_plan I plan.

Lemma staged_parts : numbers_ok I C [] = true /\ over_time M = false /\ 0 < coarse
  /\ (forall k, In k (classes I) -> views_in_reach_ok I C k 0 (in_reach I k) = true).
Proof.
  pose proof ok as H. unfold staged_numbers_ok in H. split_andb. to_Z. rewrite forallb_forall in *.
  match goal with H : negb _ = true |- _ => apply negb_true_iff in H end. auto.
Qed.

Lemma numbers_fine : numbers_ok I C [] = true.
Proof. apply staged_parts. Qed.

Lemma units_fine : units_ok I M = true.
Proof. apply (ok_parts I C [] numbers_fine). Qed.

Lemma groups_fine : forallb (group_ok I M) (groups I) = true.
Proof. apply (ok_parts I C [] numbers_fine). Qed.

Lemma precision_pos : 0 < precision M.
Proof. destruct (units I M units_fine) as [_ [H _]]. exact H. Qed.

Lemma of_plan f : In f plan -> exists starts, In (fst f, starts) (team I) /\ In (snd f O) starts /\ flown I f.
Proof.
  destruct planned as [H _]. intros Hf. clear ok planned. induction H as [|d g ds gs [E1 E2] H IH]; [contradiction|].
  destruct Hf as [<- | Hf].
  - destruct d as [k starts], g as [k' p]. simpl in E1, E2. subst k'. destruct E2 as [Hs [Ho Hm]].
    exists starts. split; [|split; [exact Hs | split; assumption]]. simpl. left. reflexivity.
  - destruct (IH Hf) as [starts [H1 H2]]. exists starts. split; [right; exact H1 | exact H2].
Qed.

Lemma class_in f : In f plan -> In (fst f) (classes I).
Proof.
  intros Hf. destruct (of_plan f Hf) as [starts [Hin _]]. unfold classes. apply nodup_In, in_map_iff.
  exists (fst f, starts). auto.
Qed.

Lemma views_fine f t : In f plan -> (t <= T)%nat -> views_ok I M (fst f) t (snd f t) = true.
Proof.
  intros Hf Ht. destruct (of_plan f Hf) as [starts [Hin [Hs Hfl]]].
  pose proof (reach_ok I (fst f) starts f Hin eq_refl Hs Hfl) as HR.
  destruct staged_parts as [_ [_ [_ Hv]]].
  apply (views_in_reach I C (fst f) _ 0 (S T) (snd f) (Hv _ (class_in f Hf)) HR). lia.
Qed.

(** The worth of what is seen at a step, in 1/precision. *)
Definition FR (t : nat) : R := (IZR (precision M) * step_worth I plan t)%R.

Definition prices_sum (b : by_state) (t : nat) : Z := sumZ (map (fun f => number_of b (fst f) (snd f t)) plan).

Definition step_inv (t : nat) (st : step) : Prop :=
  (forall f, In f plan -> exists v, PM.find (snd f t) (map_of (u_prices (now st)) (fst f)) = Some v)
  /\ (forall u, In u (now st :: earlier st) -> (FR t <= IZR (u_constant u + prices_sum (u_prices u) t))%R)
  /\ (IZR (floor st + prices_sum (charges st) t) <= FR t)%R.

Definition inv (N : narrowing) : Prop :=
  length N = S T /\ forall t, (t <= T)%nat -> step_inv t (at_ N t).

Definition worth_of (N : narrowing) (f : flight) : Z := value T (step_price N (fst f)) (toll' (fst f)) (snd f).

Definition all_prices (N : narrowing) : Z := total (S T) (fun t => prices_sum (u_prices (now (at_ N t))) t).

Lemma worths_of N : sumZ (map (worth_of N) plan)
  = all_prices N + sumZ (map (fun f => total T (fun t => reward I C (fst f) (snd f t) (snd f (S t)))) plan)
    - sumZ (map (fun r => sign r * multiplier r * plan_uses I (used r) plan) rs).
Proof.
  rewrite <- charges_of_plan. unfold all_prices, prices_sum. rewrite total_sum.
  enough (E : sumZ (map (worth_of N) plan)
    = sumZ (map (fun f => total (S T) (fun t => number_of (u_prices (now (at_ N t))) (fst f) (snd f t))) plan)
      + sumZ (map (fun f => total T (fun t => reward I C (fst f) (snd f t) (snd f (S t)))) plan)
      + -1 * sumZ (map (fun f => sumZ (map (fun r => sign r * multiplier r * path_uses I (used r) f) rs)) plan)) by lia.
  rewrite <- sumZ_scale, <- !sumZ_add. apply sumZ_ext. intros f _. rewrite <- charges_of_path.
  unfold worth_of, value.
  assert (E1 : total (S T) (fun t => step_price N (fst f) t (snd f t))
     = total (S T) (fun t => number_of (u_prices (now (at_ N t))) (fst f) (snd f t)) + -1 * total (S T) (fun t => charge_here I rs (fst f) t (snd f t))).
  { rewrite <- total_scale, <- total_add. apply total_ext. intros. unfold step_price. lia. }
  assert (E2 : total T (fun t => toll' (fst f) t (snd f t) (snd f (S t)))
     = total T (fun t => reward I C (fst f) (snd f t) (snd f (S t)))
       + -1 * total T (fun t => charge_moving I rs (fst f) t (snd f t) (snd f (S t)))).
  { rewrite <- total_scale, <- total_add. apply total_ext. intros. unfold toll', toll. lia. }
  rewrite E1, E2. lia.
Qed.

Lemma J_steps N : (J I plan * IZR (precision M)
  <= sumR (map FR (seq 0 (S T))) + IZR (sumZ (map (worth_of N) plan) - all_prices N + row_constant C []))%R.
Proof.
  pose proof (worth_steps I M units_fine groups_fine plan views_fine) as HW.
  pose proof (bonuses_R I C [] plan numbers_fine) as HB.
  pose proof (rows_hold I C [] plan numbers_fine planned (Forall_nil _)) as HR.
  pose proof precision_pos as Zp. pose proof (IZR_pos _ Zp) as Pp.
  rewrite worths_of. unfold J.
  set (bonus_sum := sumZ (map (fun f => total T (fun t => reward I C (fst f) (snd f t) (snd f (S t)))) plan)) in *.
  apply Rle_trans with (IZR (precision M) * sumR (map (step_worth I plan) (seq 0 (S T))) + IZR bonus_sum)%R.
  - rewrite Rmult_plus_distr_r. apply Rplus_le_compat.
    + rewrite Rmult_comm. apply Rmult_le_compat_l; [lra | exact HW].
    + apply (Rmult_le_compat_r (IZR (precision M))) in HB; [|lra].
      unfold Rdiv in HB at 2. rewrite Rmult_assoc, Rinv_l, Rmult_1_r in HB by lra. exact HB.
  - apply Rplus_le_compat.
    + unfold FR. rewrite sumR_scale. lra.
    + apply IZR_le. lia.
Qed.

Section Above.
Variable target : Z.
Hypothesis above : (IZR target < J I plan * IZR (precision M))%R.

(** What a plan above the target loses at a step, and on its drones' paths, is less than there is. *)
Lemma losses N t : inv N -> (t <= T)%nat ->
  (IZR target < FR t - IZR (u_constant (now (at_ N t)) + prices_sum (u_prices (now (at_ N t))) t)
     + IZR (total_constant N + row_constant C [] + sumZ (map (worth_of N) plan)))%R.
Proof.
  intros [Hlen HN] Ht. eapply Rlt_le_trans; [exact above|]. eapply Rle_trans; [apply (J_steps N)|].
  set (p := fun t => prices_sum (u_prices (now (at_ N t))) t). set (K := fun t => u_constant (now (at_ N t))).
  assert (EK : total_constant N = total (S T) K).
  { unfold total_constant, K, at_. rewrite (sum_nth (fun st => u_constant (now st)) no_step), Hlen. reflexivity. }
  assert (Hsum : forall n, (n <= S T)%nat -> (sumR (map FR (seq 0 n)) <= IZR (total n (fun t => K t + p t)%Z) + (if Nat.ltb t n then FR t - IZR (K t + p t) else 0))%R).
  { induction n as [|n IH]; intros Hn; [simpl; lra|].
    rewrite seq_S, map_app, sumR_app. cbn [map sumR total plus]. rewrite plus_IZR. specialize (IH ltac:(lia)).
    destruct (HN n ltac:(lia)) as [_ [HU _]]. specialize (HU (now (at_ N n)) (or_introl eq_refl)). fold (K n) (p n) in HU.
    destruct (Nat.ltb_spec t n), (Nat.ltb_spec t (S n)); try lia; try lra.
    assert (t = n) by lia. subst n. lra. }
  specialize (Hsum (S T) (le_n _)). destruct (Nat.ltb_spec t (S T)); [|lia].
  fold (p t) (K t). unfold all_prices. fold p.
  rewrite total_add in Hsum. rewrite EK.
  rewrite ?plus_IZR, ?minus_IZR in *. fold p. lra.
Qed.

(** ** Sweeps *)

Lemma left_path N f : inv N -> In f plan -> forall t, (t <= T)%nat -> is_left N (fst f) t (snd f t) = true.
Proof.
  intros [_ HN] Hf t Ht. destruct (HN t Ht) as [HL _]. destruct (HL f Hf) as [v E]. unfold is_left. rewrite E. reflexivity.
Qed.

Lemma left_forward_ok N f price toll starts v : inv N -> In f plan -> In (snd f O) (fst starts) -> snd starts = v ->
  forall l, In starts l ->
  Forall2 (fun m j => reaches (PM.find (snd f j) m) (v + so_far price toll (snd f) j))
    (left_forward N (fst f) price toll l) (seq 0 (S T)).
Proof.
  intros HN Hf Hs Hv l Hl. destruct (of_plan f Hf) as [st [Hd [_ [Ho Hm]]]].
  pose proof (left_path N f HN Hf) as HL.
  unfold left_forward. apply forward_ok with (T := T); try assumption; [reflexivity|].
  simpl so_far. rewrite Z.add_0_r. specialize (HL O ltac:(lia)).
  set (alive := is_left N (fst f) 0) in *.
  set (put := fun (w : Z) m s => if alive s then lift s w m else m).
  assert (Hput : forall w ss m c, reaches (PM.find (snd f O) m) c -> reaches (PM.find (snd f O) (fold_left (put w) ss m)) c).
  { intros w. induction ss as [|x ss IH]; intros m c H; simpl; [exact H|]. apply IH. unfold put.
    destruct (alive x); [apply lift_old|]; exact H. }
  assert (Hall : forall ls m c, reaches (PM.find (snd f O) m) c ->
     reaches (PM.find (snd f O) (fold_left (fun m (sv : list state * Z) => fold_left (put (snd sv)) (fst sv) m) ls m)) c).
  { induction ls as [|x ls IH]; intros m c H; simpl; [exact H|]. apply IH, Hput, H. }
  change (reaches (PM.find (snd f O) (fold_left (fun m (sv : list state * Z) => fold_left (put (snd sv)) (fst sv) m) l (PM.empty Z))) v).
  generalize (PM.empty Z). induction l as [|x l IH]; intros m; [contradiction|]. simpl. destruct Hl as [-> | Hl]; [|apply IH, Hl].
  apply Hall. rewrite Hv. clear - Hs HL. revert m. induction (fst starts) as [|y ys IHy]; intros m; [contradiction|]. simpl.
  destruct Hs as [-> | Hs]; [|apply IHy, Hs].
  assert (Hput' : forall ss m c, reaches (PM.find (snd f O) m) c -> reaches (PM.find (snd f O) (fold_left (put v) ss m)) c).
  { induction ss as [|x ss IH]; intros m0 c H; simpl; [exact H|]. apply IH. unfold put.
    destruct (alive x); [apply lift_old|]; exact H. }
  apply Hput'. unfold put. rewrite HL. apply lift_new.
Qed.

Lemma starts_in_ok k starts : In (k, starts) (team I) -> In starts (starts_in k).
Proof.
  intros H. unfold starts_in. apply in_map_iff. exists (k, starts). split; [reflexivity|].
  apply filter_In. split; [exact H | apply Nat.eqb_refl].
Qed.

Lemma to_go_ok N f : inv N -> In f plan ->
  Forall2 (fun V j => comes_to V (snd f j) (to_go (step_price N (fst f)) (toll' (fst f)) (snd f) (T - j) j))
    (to_go_of N (fst f)) (seq 0 (S T)).
Proof.
  intros HN Hf. destruct (of_plan f Hf) as [starts [Hd [Hs [Ho Hm]]]]. unfold to_go_of.
  apply (backward_ok T (moves I (fst f)) (step_price N (fst f)) (toll' (fst f)) (snd f) Hm T 0); [lia|].
  pose proof (left_forward_ok N f (fun _ _ => 0) (fun _ _ _ => 0) (starts, 0) 0 HN Hf Hs eq_refl
    (map (fun l => (l, 0)) (starts_in (fst f)))) as H.
  assert (Hin : In (starts, 0) (map (fun l => (l, 0)) (starts_in (fst f)))).
  { apply in_map_iff. exists starts. split; [reflexivity | apply starts_in_ok, Hd]. }
  specialize (H Hin). clear - H. induction H as [|m j ms js [u [E _]] H IH]; constructor; [exists u; exact E | exact IH].
Qed.

(** What a drone gets at most. *)
Definition best_of (N : narrowing) (d : nat * list state) : option Z :=
  best_start (first_of (to_go_of N (fst d))) (snd d).

Lemma best_ok N d f : inv N -> In f plan -> fst f = fst d -> In (snd f O) (snd d) ->
  reaches (best_of N d) (worth_of N f).
Proof.
  intros HN Hf Ek Hs. pose proof (to_go_ok N f HN Hf) as H. unfold best_of. rewrite <- Ek.
  destruct (to_go_of N (fst f)) as [|V Vs]; [inversion H|]. simpl seq in H. apply Forall2_head in H. destruct H as [H _].
  simpl first_of. apply (best_start_ok V (snd d) (snd f O)); [exact Hs|].
  rewrite Nat.sub_0_r in H. unfold worth_of.
  rewrite <- (value_split T (step_price N (fst f)) (toll' (fst f)) (snd f) T 0 ltac:(lia)). simpl so_far. rewrite Z.add_0_l. exact H.
Qed.

Definition best_number (N : narrowing) (d : nat * list state) : Z := match best_of N d with Some b => b | None => 0 end.

(** A drone and its path, and the most that it gets. *)
Definition paired (N : narrowing) (d : nat * list state) (f : flight) : Prop :=
  (fst f = fst d /\ In (snd f O) (snd d) /\ reaches (best_of N d) (worth_of N f)) /\ In d (team I) /\ In f plan.

Lemma team_pairs N : inv N -> Forall2 (paired N) (team I) plan.
Proof.
  intros HN. destruct planned as [HF _]. apply Forall2_in in HF.
  assert (H : forall ds fs, Forall2 (fun d f => (fst f = fst d /\ is_flight I (snd d) f) /\ In d (team I) /\ In f plan) ds fs ->
    Forall2 (paired N) ds fs).
  { induction 1 as [|d f ds fs [[E1 E2] [Hd Hf]] H IH]; constructor; [|exact IH].
    assert (Hs : In (snd f O) (snd d)) by (destruct f as [k p]; destruct E2 as [Hs _]; exact Hs).
    split; [|split; assumption]. repeat split; try assumption. apply best_ok; assumption. }
  apply H, HF.
Qed.

Lemma paired_of N f : inv N -> In f plan -> exists d, paired N d f.
Proof.
  intros HN. assert (X : forall ds fs, Forall2 (paired N) ds fs -> In f fs -> exists d, paired N d f).
  { induction 1 as [|d g ds fs Hp H IH]; [intros []|]. intros [<- | Hin]; [exists d; exact Hp | apply IH, Hin]. }
  apply (X _ _ (team_pairs N HN)).
Qed.

Lemma team_best_is N : inv N ->
  left_bound N (sweep_all N) = Some (total_constant N + row_constant C [] + sumZ (map (best_number N) (team I)))
  /\ sumZ (map (worth_of N) plan) <= sumZ (map (best_number N) (team I)).
Proof.
  intros HN. pose proof (team_pairs N HN) as HF. unfold left_bound.
  assert (H : forall ds fs, Forall2 (paired N) ds fs ->
    team_best (fun k => first_of (of_class [] (sweep_all N) k)) ds = Some (sumZ (map (best_number N) ds))
    /\ sumZ (map (worth_of N) fs) <= sumZ (map (best_number N) ds)).
  { induction 1 as [|d f ds fs [[E [Hs [b [Eb Hb]]]] [Hd Hf]] H [IH1 IH2]]; [split; [reflexivity | simpl; lia]|].
    destruct d as [k starts]. cbn [team_best].
    assert (Ek : of_class [] (sweep_all N) k = to_go_of N k).
    { unfold sweep_all. apply of_class_map. simpl in E. subst k. apply class_in, Hf. }
    rewrite Ek. unfold best_of in Eb. cbn [fst snd] in Eb. rewrite Eb, IH1.
    assert (En : best_number N (k, starts) = b) by (unfold best_number, best_of; cbn [fst snd]; rewrite Eb; reflexivity).
    cbn [map sumZ]. rewrite En. split; [reflexivity | lia]. }
  destruct (H _ _ HF) as [E1 E2]. rewrite E1. split; [reflexivity | exact E2].
Qed.

Lemma bests_in k starts N : In (k, starts) (team I) -> forall b, best_of N (k, starts) = Some b ->
  In (starts, b) (bests_of (to_go_of N k) k).
Proof.
  intros Hd b Hb. unfold bests_of. apply in_map_iff. exists starts. unfold best_of in Hb. simpl in Hb. rewrite Hb.
  split; [reflexivity | apply starts_in_ok, Hd].
Qed.

(** ** Closing *)

Lemma close_ok N : inv N -> exists N', close target N = Some N' /\ inv N'.
Proof.
  intros HN. unfold close. destruct (team_best_is N HN) as [EB Hworths]. rewrite EB.
  set (B := total_constant N + row_constant C [] + sumZ (map (best_number N) (team I))) in *.
  eexists. split; [reflexivity|]. destruct HN as [Hlen Hsteps]. pose proof (conj Hlen Hsteps : inv N) as HN.
  split; [rewrite with_steps_length; exact Hlen|]. intros t Ht.
  unfold at_. rewrite with_steps_nth by lia. rewrite Nat.add_0_l. fold (at_ N t).
  set (so_far := map (fun k => (k, left_forward N k (step_price N k) (toll' k)
      (map (fun sv => (fst sv, - snd sv)) (bests_of (of_class [] (sweep_all N) k) k)))) (classes I)).
  set (st := at_ N t). destruct (Hsteps t Ht) as [HL [HU HF]].
  pose proof (losses N t HN Ht) as Hloss. fold st in Hloss, HL, HU, HF.
  set (slack_of := fun f : flight => match PM.find (snd f t) (nth t (of_class [] so_far (fst f)) (PM.empty Z)),
      PM.find (snd f t) (nth t (of_class [] (sweep_all N) (fst f)) (PM.empty _)) with
      | Some u, Some (Some v) => - (u + v) | _, _ => 0 end).
  (* the slack of a drone's state is no more than what its path loses *)
  assert (Hslack : forall d f, paired N d f -> (exists u v,
      PM.find (snd f t) (nth t (of_class [] so_far (fst f)) (PM.empty Z)) = Some u
      /\ PM.find (snd f t) (nth t (of_class [] (sweep_all N) (fst f)) (PM.empty _)) = Some (Some v))
      /\ slack_of f <= best_number N d - worth_of N f /\ worth_of N f <= best_number N d).
  { intros [k starts] f [[Ek [Hs [b [Eb Hb]]]] [Hd Hf]]. simpl in Ek, Hs.
    assert (Ego : of_class [] (sweep_all N) (fst f) = to_go_of N (fst f)) by (apply of_class_map, class_in, Hf).
    pose proof (to_go_ok N f HN Hf) as HV.
    destruct (Forall2_seq_nth _ (PM.empty _) _ _ _ HV t ltac:(lia)) as [v [Ev Hv]]. rewrite Nat.add_0_l in Ev, Hv.
    pose proof (left_forward_ok N f (step_price N (fst f)) (toll' (fst f)) (starts, - b) (- b) HN Hf Hs eq_refl
       (map (fun sv => (fst sv, - snd sv)) (bests_of (to_go_of N (fst f)) (fst f)))) as HW.
    assert (Hin : In (starts, - b) (map (fun sv => (fst sv, - snd sv)) (bests_of (to_go_of N (fst f)) (fst f)))).
    { apply in_map_iff. exists (starts, b). split; [reflexivity|]. rewrite Ek. apply bests_in; [exact Hd | exact Eb]. }
    specialize (HW Hin).
    destruct (Forall2_seq_nth _ (PM.empty _) _ _ _ HW t ltac:(lia)) as [u [Eu Hu]]. rewrite Nat.add_0_l in Eu, Hu.
    assert (Eu' : PM.find (snd f t) (nth t (of_class [] so_far (fst f)) (PM.empty Z)) = Some u).
    { unfold so_far. rewrite (of_class_map [] (fun k => left_forward N k (step_price N k) (toll' k)
        (map (fun sv => (fst sv, - snd sv)) (bests_of (of_class [] (sweep_all N) k) k)))) by (apply class_in, Hf).
      rewrite Ego. exact Eu. }
    assert (Ev' : PM.find (snd f t) (nth t (of_class [] (sweep_all N) (fst f)) (PM.empty _)) = Some (Some v)) by (rewrite Ego; exact Ev).
    split; [exists u, v; split; assumption|].
    assert (En : best_number N (k, starts) = b) by (unfold best_number; rewrite Eb; reflexivity). rewrite En.
    unfold slack_of. rewrite Eu', Ev'.
    pose proof (value_split T (step_price N (fst f)) (toll' (fst f)) (snd f) (T - t) t ltac:(lia)) as Esplit.
    fold (worth_of N f) in Esplit. lia. }
  assert (Hsums : forall ds fs, Forall2 (paired N) ds fs ->
     sumZ (map (worth_of N) fs) <= sumZ (map (best_number N) ds)
     /\ sumZ (map slack_of fs) + sumZ (map (worth_of N) fs) <= sumZ (map (best_number N) ds)
     /\ forall f, In f fs -> slack_of f + sumZ (map (worth_of N) fs) <= sumZ (map (best_number N) ds)).
  { induction 1 as [|d f ds fs Hp H [IH1 [IH2 IH3]]]; [repeat split; simpl; try lia; intros f []|].
    destruct (Hslack d f Hp) as [_ [S1 S2]]. cbn [map sumZ]. repeat split; try lia.
    intros g [<- | Hg]; [lia|]. specialize (IH3 g Hg). lia. }
  destruct (Hsums _ _ (team_pairs N HN)) as [_ [Htogether Heach]].
  set (K := u_constant (now st)) in *. set (P := prices_sum (u_prices (now st)) t) in *.
  pose proof (HU (now st) (or_introl eq_refl)) as Hnow. fold K P in Hnow.
  assert (Hroom : forall f, In f plan -> slack_of f <= B - target).
  { intros f Hf. specialize (Heach f Hf). apply le_IZR.
    apply IZR_le in Heach. rewrite ?plus_IZR, ?minus_IZR in *. unfold B. rewrite !plus_IZR. lra. }
  assert (Hkept : forall (h : nat -> state -> Z -> Z) f, In f plan ->
    PM.find (snd f t) (map_of (map (fun k => (k, build_map (fun s u =>
         match (match PM.find s (nth t (of_class [] (sweep_all N) k) (PM.empty _)) with Some (Some v) => Some (- (u + v)) | _ => None end) with
         | Some l => if l <=? B - target then Some (h k s l) else None
         | None => None end) (nth t (of_class [] so_far k) (PM.empty Z)))) (classes I)) (fst f)) = Some (h (fst f) (snd f t) (slack_of f))).
  { intros h f Hf.
    pose proof (paired_of N f HN Hf) as Hd.
    destruct Hd as [d Hp]. destruct (Hslack d f Hp) as [[u [v [Eu Ev]]] _].
    rewrite map_of_map by (apply class_in, Hf).
    apply find_build_map with (u := u); [exact Eu|]. rewrite Ev.
    assert (Es : slack_of f = - (u + v)) by (unfold slack_of; rewrite Eu, Ev; reflexivity).
    rewrite Es. pose proof (Hroom f Hf) as Hr. rewrite Es in Hr. apply Z.leb_le in Hr. rewrite Hr. reflexivity. }
  assert (Hnumbers : forall (h : nat -> state -> Z -> Z),
    prices_sum (map (fun k => (k, build_map (fun s u =>
         match (match PM.find s (nth t (of_class [] (sweep_all N) k) (PM.empty _)) with Some (Some v) => Some (- (u + v)) | _ => None end) with
         | Some l => if l <=? B - target then Some (h k s l) else None
         | None => None end) (nth t (of_class [] so_far k) (PM.empty Z)))) (classes I)) t
    = sumZ (map (fun f => h (fst f) (snd f t) (slack_of f)) plan)).
  { intros h. unfold prices_sum. apply sumZ_ext. intros f Hf. unfold number_of. rewrite (Hkept h f Hf). reflexivity. }
  unfold closed_step. cbv zeta. fold K. split; [|split].
  - intros f Hf. simpl. eexists. apply (Hkept (fun k s _ => number_of (u_prices (now st)) k s) f Hf).
  - simpl. intros u [<- | Hu].
    + simpl. rewrite (Hnumbers (fun k s _ => number_of (u_prices (now st)) k s)). exact Hnow.
    + apply HU. right. exact Hu.
  - simpl. rewrite (Hnumbers (fun k s l => number_of (u_prices (now st)) k s + l)).
    rewrite sumZ_add. change (sumZ (map (fun f => number_of (u_prices (now st)) (fst f) (snd f t)) plan)) with P.
    clear Hkept Hnumbers Heach Hroom Hsums. set (slacks := sumZ (map slack_of plan)) in Htogether.
    change (sumZ (map _ plan)) with slacks. set (worths := sumZ (map (worth_of N) plan)) in *.
    set (bests := sumZ (map (best_number N) (team I))) in *.
    apply IZR_le in Htogether. unfold B. rewrite ?plus_IZR, ?minus_IZR in *. rewrite ?plus_IZR in *. lra.
Qed.

Lemma close_twice_ok N : inv N -> exists N', close_twice target N = Some N' /\ inv N'.
Proof.
  intros HN. destruct (close_ok N HN) as [N1 [E1 H1]]. destruct (close_ok N1 H1) as [N2 [E2 H2]].
  exists N2. unfold close_twice. rewrite E1. auto.
Qed.

(** ** The search of a step *)

Lemma step_groups_ok t : gs_ok (step_groups t).
Proof.
  intros g Hg. unfold step_groups in Hg. apply filter_In in Hg. destruct Hg as [Hg _].
  destruct (group_parts I M g (group_is_ok I M groups_fine g Hg)) as [H1 [_ H2]]. auto.
Qed.

Lemma step_worth_groups t : (t <= T)%nat ->
  (sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g)) (step_groups t)) = FR t)%R.
Proof.
  intros Ht. unfold FR, step_worth. rewrite <- sumR_scale. unfold step_groups.
  assert (H : forall gs, (forall g, In g gs -> In g (groups I)) ->
    (sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g))
       (filter (fun g => Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) gs))
     = sumR (map (fun g => IZR (precision M) * worth I g (seen_at I plan t g)) gs))%R).
  { induction gs as [|g gs IH]; intros Hgs; [reflexivity|]. specialize (IH (fun g' Hg' => Hgs g' (or_intror Hg'))).
    simpl. destruct (Nat.eqb (at_step (prices M g)) t && (0 <? weight I g)) eqn:E; simpl; rewrite IH; [reflexivity|].
    pose proof (group_is_ok I M groups_fine g (Hgs g (or_introl eq_refl))) as Hok.
    destruct (group_parts I M g Hok) as [Hw [_ Hr]].
    enough (E0 : worth I g (seen_at I plan t g) = 0%R) by (rewrite E0; lra).
    apply andb_false_iff in E. destruct E as [E | E].
    - apply Nat.eqb_neq in E.
      replace (seen_at I plan t g) with 0; [apply (worth_zero I M g Hok)|]. symmetry. unfold seen_at. apply sumZ_zero.
      intros f Hf. destruct staged_parts as [_ [Ho _]].
      apply (views_ok_parts I M groups_fine (fst f) t (snd f t) (views_fine f t Hf Ht)); assumption.
    - apply Z.ltb_ge in E. assert (W0 : weight I g = 0) by lia. unfold worth. rewrite W0. unfold Rdiv. rewrite !Rmult_0_l. reflexivity. }
  apply H. auto.
Qed.

Lemma team_size : length plan = length (team I).
Proof. destruct planned as [H _]. symmetry. apply (Forall2_lengths _ _ _ H). Qed.

Lemma classes_of_plan : map fst plan = map fst (team I).
Proof. apply (team_classes I plan planned). Qed.

Lemma fits_pairs (cf : flight -> candidate) t : (t <= T)%nat ->
  (forall f, In f plan -> name named (cf f) = here (fst f) (snd f t)) ->
  fits_together named places_meet (map cf plan).
Proof.
  intros Ht Hname. destruct planned as [_ H]. unfold fits_together. clear ok above planned.
  induction H as [|f l Hf H IH]; simpl; [constructor|]. constructor; [|apply IH; intros; apply Hname; right; assumption].
  rewrite Forall_map. apply Forall_forall. intros g Hg. rewrite Forall_forall in Hf.
  rewrite (Hname f) by (left; reflexivity). rewrite (Hname g) by (right; exact Hg).
  unfold places_meet, here. simpl. destruct (Hf g Hg) as [Hm _]. rewrite (Hm t Ht). reflexivity.
Qed.

(** The drones' states at a step, with any prices, are a joint state that counts. *)
Definition flown_candidate (st : step) (t : nat) (nm : flight -> named) (pr : flight -> Z) (f : flight) : candidate :=
  candidate_of (step_groups t) t (fst f) (nm f) (pr f) (number_of (charges st) (fst f) (snd f t))
    (step_static st (fst f) (snd f t) (pr f)) (snd f t).

Lemma flown_candidates_ok st t nm pr : (t <= T)%nat ->
  Forall (cand_ok named (amount_unit I) coarse (specs_of (step_groups t))) (map (flown_candidate st t nm pr) plan).
Proof.
  intros Ht. apply Forall_forall. intros c Hc. apply in_map_iff in Hc. destruct Hc as [f [<- Hf]]. split; [|split].
  - simpl. unfold specs_of. rewrite !map_length. reflexivity.
  - simpl. apply Forall_forall. intros z Hz. apply in_map_iff in Hz. destruct Hz as [g [<- Hg]].
    apply (views_ok_parts I M groups_fine _ _ _ (views_fine f t Hf Ht)).
  - reflexivity.
Qed.

Lemma flown_worth st t nm pr : (t <= T)%nat ->
  F named (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) (map (flown_candidate st t nm pr) plan) = FR t.
Proof.
  intros Ht. rewrite <- (step_worth_groups t Ht). unfold F.
  set (amt := fun g (f : flight) => amount I g (fst f) t (snd f t)).
  rewrite (worth_ext _ _ _ _ _ (fun j => sumZ (map (fun f => nth j (map (fun g => amt g f) (step_groups t)) 0) plan))).
  - rewrite (worth_of_groups (step_groups t) amt plan). reflexivity.
  - intros j. unfold together. rewrite map_map. reflexivity.
Qed.

Lemma flown_counts conflict st t nm pr : (t <= T)%nat -> step_inv t st ->
  fits_together named conflict (map (flown_candidate st t nm pr) plan) ->
  counts named conflict (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) (step_bases st) (floor st)
    (map (flown_candidate st t nm pr) plan).
Proof.
  intros Ht [HL [HU HF]] Hfits. set (cf := flown_candidate st t nm pr) in *.
  pose proof (flown_worth st t nm pr Ht) as HFL. fold cf in HFL.
  assert (Hprice : sum named (price named) (map cf plan) = sumZ (map pr plan)).
  { unfold sum. rewrite map_map. reflexivity. }
  assert (Hcharge : sum named (charge named) (map cf plan) = prices_sum (charges st) t).
  { unfold sum, prices_sum. rewrite map_map. reflexivity. }
  split; [|split; [|exact Hfits]].
  - intros j il b Hj. unfold step_bases in Hj. destruct j as [|j]; simpl in Hj.
    + injection Hj as <- <-. pose proof (HU (now st) (or_introl eq_refl)) as Hn.
      assert (Es : static_sum named 0 (map cf plan) = prices_sum (u_prices (now st)) t - prices_sum (charges st) t).
      { unfold static_sum, prices_sum. rewrite map_map. simpl. clear. induction plan as [|f l IH]; simpl; lia. }
      rewrite Es. apply le_IZR. rewrite ?plus_IZR, ?minus_IZR in *. simpl. lra.
    + assert (Hj' : nth_error (map (fun u => (false, u_constant u)) (now st :: earlier st)) j = Some (il, b)) by exact Hj.
      rewrite nth_error_map in Hj'. destruct (nth_error (now st :: earlier st) j) as [u|] eqn:Eu; [|discriminate].
      simpl in Hj'. injection Hj' as <- <-. apply nth_error_In in Eu as Hu.
      assert (Es : static_sum named (S j) (map cf plan) = prices_sum (u_prices u) t - sumZ (map pr plan)).
      { unfold static_sum, prices_sum. rewrite map_map.
        assert (E : forall f, nth (S j) (static named (cf f)) 0 = number_of (u_prices u) (fst f) (snd f t) - pr f).
        { intros f. unfold cf, flown_candidate, candidate_of, step_static. cbn [static nth].
          rewrite (nth_indep _ 0 (number_of (u_prices u) (fst f) (snd f t) - pr f)).
          - rewrite (map_nth (fun u0 => number_of (u_prices u0) (fst f) (snd f t) - pr f) (now st :: earlier st) u).
            rewrite (nth_error_nth _ _ _ Eu). reflexivity.
          - rewrite map_length. apply nth_error_Some. congruence. }
        rewrite (map_ext _ _ E). clear. induction plan as [|f l IH]; cbn [map sumZ]; lia. }
      rewrite Es. unfold profitR. rewrite HFL, Hprice. pose proof (HU u Hu) as Hn.
      rewrite ?plus_IZR, ?minus_IZR in *. lra.
  - rewrite HFL, Hcharge. rewrite plus_IZR in HF. exact HF.
Qed.

Lemma worth_of_none t : F named (amount_unit I) (weight_unit I) (precision M) (specs_of (step_groups t)) [] = 0%R.
Proof.
  unfold F. rewrite (worth_ext _ _ _ _ _ (fun j => sumZ (map (fun f : flight => nth j (map (fun g => (fun _ _ => 0) g f) (step_groups t)) 0) []))) by reflexivity.
  rewrite (worth_of_groups (step_groups t) (fun _ _ => 0) []). simpl. apply sumR_zero. intros g Hg. unfold worth.
  destruct (step_groups_ok t g Hg) as [_ Hr]. unfold Rdiv at 2. rewrite Rmult_0_l, return_zero by exact Hr. ring.
Qed.

Lemma after_constant_ok stg t claim st : (t <= T)%nat -> step_inv t st -> step_inv t (after_constant stg t claim st).
Proof.
  intros Ht Hinv. pose proof Hinv as [HL [HU HF]]. unfold after_constant. set (prices := repriced st t stg).
  (* the new prices are of the same states *)
  assert (Hnew : forall f, In f plan -> exists p, PM.find (snd f t) (map_of prices (fst f)) = Some p).
  { intros f Hf. unfold prices, repriced. destruct (HL f Hf) as [v E].
    set (new := fun k => let old := map_of (u_prices (now st)) k in
      match find (fun e => Nat.eqb t (fst (fst e)) && Nat.eqb k (snd (fst e))) (payments stg) with
        | None => old
        | Some (_, (listed, others)) =>
            let table := fold_left (fun m sv => PM.add (fst sv) (snd sv) m) listed (PM.empty Z) in
            PM.mapi (fun s v => match PM.find s table with Some p => p | None => v + others end) old
        end).
    change (exists p, PM.find (snd f t) (map_of (map (fun k => (k, new k)) (classes I)) (fst f)) = Some p).
    rewrite map_of_map by (apply class_in, Hf). unfold new. cbv zeta.
    destruct (find _ (payments stg)) as [[e [listed others]]|]; [|exists v; exact E].
    rewrite mapi_find, E. simpl. eexists. reflexivity. }
  split; [exact Hnew|]. split; [|exact HF].
  intros u [<- | Hu]; [|apply HU; exact Hu]. cbn [u_constant u_prices].
  set (gs := step_groups t).
  set (pr := fun f : flight => number_of prices (fst f) (snd f t)).
  set (cf := flown_candidate st t (fun f => here (fst f) (snd f t)) pr).
  pose proof (step_groups_ok t) as Hgs. fold gs in Hgs.
  pose proof (flown_candidates_ok st t (fun f => here (fst f) (snd f t)) pr Ht) as Hcf. fold cf gs in Hcf.
  pose proof (flown_worth st t (fun f => here (fst f) (snd f t)) pr Ht) as HFL. fold cf gs in HFL.
  assert (Hprice : sum named (price named) (map cf plan) = prices_sum prices t).
  { unfold sum, prices_sum. rewrite map_map. reflexivity. }
  pose proof (flown_counts places_meet st t (fun f => here (fst f) (snd f t)) pr Ht Hinv (fits_pairs cf t Ht (fun f _ => eq_refl))) as Hcounts.
  fold cf gs in Hcounts.
  set (Ls := map (fun k => map cf (filter (fun f => Nat.eqb k (fst f)) plan)) (classes I)).
  assert (HLs : Permutation (concat Ls) (map cf plan)).
  { unfold Ls. rewrite <- (map_map (fun k => filter (fun f : flight => Nat.eqb k (fst f)) plan) (map cf)), <- concat_map.
    apply Permutation_map. apply by_class_permutes; [apply NoDup_nodup | apply class_in]. }
  set (pool_ := map (fun k => (size I k, map (fun sv => step_candidate st gs t k (fst sv) (snd sv)) (PM.elements (map_of prices k)))) (classes I)).
  assert (Hpool : completes pool_ Ls).
  { unfold pool_, Ls. assert (Hin : forall k, In k (classes I) -> In k (classes I)) by auto. revert Hin. generalize (classes I) at 1 3 4 as ks.
    induction ks as [|k ks IH]; intros Hin; simpl; constructor; [|apply IH; intros; apply Hin; right; assumption]. simpl. split.
    - rewrite map_length. unfold size.
      assert (E : forall B (m : list (nat * B)), length (filter (fun x => Nat.eqb k (fst x)) m) = length (filter (Nat.eqb k) (map fst m))).
      { clear. intros B m. induction m as [|x m IH]; simpl; [reflexivity|]. destruct (Nat.eqb k (fst x)); simpl; congruence. }
      pose proof (E _ (team I)) as E2. rewrite <- classes_of_plan in E2. rewrite E2. exact (E _ plan).
    - intros c Hc. apply in_map_iff in Hc. destruct Hc as [f [<- Hf]]. apply filter_In in Hf. destruct Hf as [Hf Ek]. apply Nat.eqb_eq in Ek. subst k.
      destruct (Hnew f Hf) as [p Ep]. apply in_map_iff. exists (snd f t, p). split; [|apply PM.elements_correct, Ep].
      unfold cf, flown_candidate, pr. assert (En : number_of prices (fst f) (snd f t) = p) by (unfold number_of; rewrite Ep; reflexivity). rewrite En. reflexivity. }
  assert (Hcounts' : counts named places_meet (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (step_bases st) (floor st) ([] ++ concat Ls)).
  { eapply counts_perm; [exact places_meet_symmetric | apply Permutation_sym; exact HLs | exact Hcounts]. }
  set (Good := fun (l : list candidate) (best : Z) =>
    counts named places_meet (amount_unit I) (weight_unit I) (precision M) (specs_of gs) (step_bases st) (floor st) l ->
    Forall (cand_ok named (amount_unit I) coarse (specs_of gs)) l ->
    (profitR named (amount_unit I) (weight_unit I) (precision M) (specs_of gs) l <= IZR best)%R).
  destruct (units I M units_fine) as [_ [_ [Za Zw]]]. destruct staged_parts as [_ [_ [Zc _]]].
  assert (Hkeep : forall l l' (a : Z), Good l a -> Good l (highest gs (floor st) l' a)).
  { intros l l' a H H1 H2. eapply Rle_trans; [apply H; assumption|]. apply IZR_le. unfold highest. cbv zeta.
    destruct (_ <=? _); lia. }
  assert (HokLs : Forall (cand_ok named (amount_unit I) coarse (specs_of gs)) ([] ++ concat Ls)).
  { eapply Permutation_Forall; [apply Permutation_sym; exact HLs | exact Hcf]. }
  pose proof (worth_of_none t) as HF0. fold gs in HF0.
  pose proof (node_ok named places_meet places_meet_symmetric (amount_unit I) (weight_unit I) (precision M) coarse Za Zw precision_pos Zc
    (specs_of gs) (specs_of_ok gs Hgs) Z (fun best => best) (highest gs (floor st)) Sorted.sort sorted_permutes memory (advise (specs_of gs)) named_dec Good
    (fun l a H _ _ => H)
    ltac:(intros l a H1 H2; unfold highest; cbv zeta;
          pose proof (exact_of_ok units_fine gs l Hgs H2) as HE; destruct H1 as [_ [Hfl _]];
          assert (Hle : floor st + sum named (charge named) l <= exact_of gs l) by (apply le_IZR; rewrite plus_IZR; lra);
          apply Z.leb_le in Hle; rewrite Hle; unfold profitR; apply Rle_trans with (IZR (exact_of gs l - sum named (price named) l));
          [rewrite minus_IZR; lra | apply IZR_le; lia])
    Hkeep false
    ltac:(intros _ pre x c y post a H H1 H2;
          assert (Hp : Permutation (pre ++ x ++ c :: y ++ post) (pre ++ c :: x ++ y ++ post)) by
            (apply Permutation_app_head; symmetry; apply Permutation_middle);
          unfold profitR; rewrite (F_perm _ _ _ _ _ _ _ Hp), (sum_perm _ (price named) _ _ Hp); apply H;
          [eapply counts_perm; [exact places_meet_symmetric | exact Hp | exact H1] | eapply Permutation_Forall; eassumption])
    (step_bases st) (floor st) (length (team I)) [] (nothing (specs_of gs)) 0 (- floor st) (step_bases st) pool_ mind claim Ls Hpool) as HN.
  assert (HG : Good ([] ++ concat Ls) (most_profit st t prices claim)).
  { apply HN.
    - unfold pool_. apply Forall_forall. intros nl Hnl. apply in_map_iff in Hnl. destruct Hnl as [k [<- Hk]]. simpl.
      unfold classes in Hk. apply nodup_In, in_map_iff in Hk. destruct Hk as [d [Ek Hd]]. unfold size.
      destruct (filter (fun d => Nat.eqb k (fst d)) (team I)) as [|x l] eqn:E; [|simpl; lia]. exfalso.
      assert (X : In d []) by (rewrite <- E; apply filter_In; split; [exact Hd | rewrite Ek; apply Nat.eqb_refl]). contradiction.
    - rewrite <- team_size. replace (length plan) with (length (concat Ls)).
      2:{ rewrite (Permutation_length HLs), map_length. reflexivity. }
      clear - Hpool. induction Hpool as [|[n l] L p Ls [H _] HP IH]; simpl; [lia|]. simpl in H. rewrite app_length. lia.
    - discriminate.
    - exact HokLs.
    - eapply (nothing_ok (amount_unit I)); try eassumption. apply Forall_forall. intros sp Hsp. exact (specs_of_ok gs Hgs sp Hsp).
    - rewrite HF0. unfold sum. simpl. lra.
    - rewrite HF0. unfold sum. simpl. rewrite opp_IZR. lra.
    - apply bases_first.
    - exact Hcounts'. }
  specialize (HG Hcounts' HokLs). simpl app in HG. unfold profitR in HG.
  rewrite (F_perm _ _ _ _ _ _ _ HLs), (sum_perm _ (price named) _ _ HLs), HFL, Hprice in HG. simpl. rewrite plus_IZR. lra.
Qed.

Lemma after_stage_ok stg N : inv N -> inv (after_stage stg N).
Proof.
  unfold after_stage. revert N. induction (step_constants stg) as [|[t claim] l IH]; intros N HN; [exact HN|]. simpl.
  apply IH. destruct HN as [Hlen HN]. split; [rewrite change_length; exact Hlen|]. intros j Hj. unfold at_.
  rewrite change_nth by lia. fold (at_ N j). destruct (Nat.eqb_spec j t) as [<- | Hne]; [|apply HN, Hj].
  apply after_constant_ok; [exact Hj | apply HN, Hj].
Qed.

Lemma first_ok' : inv first_narrowing.
Proof.
  unfold first_narrowing. split; [rewrite map_length, seq_length; reflexivity|]. intros t Ht.
  assert (Hat : forall (f : nat -> step), at_ (map f (seq 0 (S T))) t = f t).
  { intros f. unfold at_. rewrite (nth_indep _ no_step (f O)) by (rewrite map_length, seq_length; lia).
    rewrite map_nth, seq_nth by lia. reflexivity. }
  rewrite Hat. destruct staged_parts as [_ [Ho _]].
  assert (Hfind : forall f, In f plan -> PM.find (snd f t) (map_of (map (fun k => (k, PM.mapi (fun s (_ : Z) => paid I M k t s)
      (nth t (of_class [] (map (fun k => (k, in_reach I k)) (classes I)) k) (PM.empty Z)))) (classes I)) (fst f)) = Some (paid I M (fst f) t (snd f t))).
  { intros f Hf. rewrite map_of_map by (apply class_in, Hf). rewrite mapi_find, of_class_map by (apply class_in, Hf).
    destruct (of_plan f Hf) as [starts [Hd [Hs Hfl]]].
    destruct (Forall2_seq_nth _ (PM.empty Z) _ _ _ (reach_ok I (fst f) starts f Hd eq_refl Hs Hfl) t ltac:(lia)) as [u Eu].
    rewrite Nat.add_0_l in Eu. rewrite Eu. reflexivity. }
  split; [|split].
  - intros f Hf. simpl. eexists. apply Hfind, Hf.
  - simpl. intros u [<- | []]. simpl.
    pose proof (step_bound I M units_fine groups_fine plan classes_of_plan views_fine t Ho Ht) as H.
    apply (Rmult_le_compat_l (IZR (precision M))) in H; [|apply IZR_nonneg; pose proof precision_pos; lia].
    unfold FR. eapply Rle_trans; [exact H|].
    replace (prices_sum _ t) with (paid_at I M plan t).
    2:{ unfold prices_sum, paid_at. apply sumZ_ext. intros f Hf. unfold number_of. rewrite (Hfind f Hf). reflexivity. }
    pose proof (IZR_pos _ precision_pos) as Pp. apply Req_le. rewrite !plus_IZR. field. lra.
  - simpl. replace (prices_sum [] t) with 0.
    2:{ unfold prices_sum. symmetry. apply sumZ_zero. intros f _. unfold number_of, map_of. simpl. rewrite PM.gempty. reflexivity. }
    simpl. unfold FR. apply Rmult_le_pos; [apply IZR_nonneg; pose proof precision_pos; lia|].
    unfold step_worth. apply sumR_nonneg. apply Forall_forall. intros x Hx. apply in_map_iff in Hx. destruct Hx as [g [<- Hg]].
    destruct (group_parts I M g (group_is_ok I M groups_fine g Hg)) as [Hw [_ Hr]]. destruct (units I M units_fine) as [_ [_ [Za Zw]]].
    unfold worth. apply Rmult_le_pos; [apply frac_nonneg; assumption|]. apply return_nonneg; [exact Hr|].
    apply frac_nonneg; [|exact Za]. unfold seen_at. apply sumZ_nonneg. intros f Hf. apply (amounts_nonneg I M groups_fine plan views_fine); assumption.
Qed.

Lemma narrowed_ok stages : exists N, narrowed target stages = Some N /\ inv N.
Proof.
  unfold narrowed. destruct (close_twice_ok _ first_ok') as [N0 [E0 H0]]. rewrite E0. clear E0.
  revert N0 H0. induction stages as [|stg rest IH]; intros N0 H0; simpl; [exists N0; auto|].
  destruct (close_twice_ok _ (after_stage_ok stg N0 H0)) as [N1 [E1 H1]]. rewrite E1. apply IH, H1.
Qed.

End Above.
End Plan.

Theorem staged_bound_sound target stages b plan :
  staged_bound target stages = Some b -> is_plan I plan -> (J I plan <= IZR b / IZR (precision M))%R.
Proof.
  unfold staged_bound. intros Hb Hp. destruct staged_numbers_ok eqn:Hok; [|discriminate]. injection Hb as <-.
  pose proof (IZR_pos _ (precision_pos Hok)) as Pp.
  apply Rmult_le_reg_r with (IZR (precision M)); [exact Pp|]. unfold Rdiv. rewrite Rmult_assoc, Rinv_l, Rmult_1_r by lra.
  destruct (Rle_dec (J I plan * IZR (precision M)) (IZR target)) as [L | G].
  - eapply Rle_trans; [exact L|]. apply IZR_le. destruct (narrowed target stages); [|lia]. destruct (left_bound _ _); lia.
  - apply Rnot_le_lt in G.
    destruct (narrowed_ok plan Hok Hp target G stages) as [N [EN HN]]. rewrite EN.
    destruct (team_best_is plan Hp N HN) as [EB Hworths]. rewrite EB.
    eapply Rle_trans; [apply (J_steps plan Hok Hp N)|].
    destruct HN as [Hlen HN].
    assert (Hsum : forall n, (n <= S T)%nat -> (sumR (map (FR plan) (seq 0 n))
       <= IZR (total n (fun t => u_constant (now (at_ N t)) + prices_sum plan (u_prices (now (at_ N t))) t)%Z))%R).
    { induction n as [|n IH]; intros Hn; [simpl; lra|]. rewrite seq_S, map_app, sumR_app. cbn [map sumR total Nat.add].
      rewrite plus_IZR. specialize (IH ltac:(lia)). destruct (HN n ltac:(lia)) as [_ [HU _]].
      specialize (HU (now (at_ N n)) (or_introl eq_refl)). lra. }
    specialize (Hsum (S T) (le_n _)). rewrite total_add in Hsum.
    assert (EK : total_constant N = total (S T) (fun t => u_constant (now (at_ N t)))).
    { unfold total_constant, at_. rewrite (sum_nth (fun st => u_constant (now st)) no_step), Hlen. reflexivity. }
    unfold all_prices.
    set (prices_all := total (S T) (fun t => prices_sum plan (u_prices (now (at_ N t))) t)) in *.
    apply Rle_trans with (IZR (total_constant N + prices_all + (sumZ (map (worth_of N) plan) - prices_all + row_constant C []))%Z).
    + rewrite EK, !plus_IZR. rewrite plus_IZR in Hsum. lra.
    + apply IZR_le. lia.
Qed.

End Staged.
