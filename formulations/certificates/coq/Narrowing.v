(** Narrowing down the plans above a target.

    No plan above the target visits a closed state, and at each step its worth is between the bounds
    that are kept of the step.  docs/concepts/step-envelopes.md has the inequalities in words. *)
From Coq Require Import ZArith List Bool Reals Lra Lia Psatz FMapPositive.
From CocapCheck Require Import Spec Sums Returns Prices Worth Rows Sweep Checker.
Import ListNotations.
Open Scope Z_scope.

(** Of each class, a number for each state. *)
Definition by_state : Type := list (nat * PM.t Z).
Definition map_of (b : by_state) (k : nat) : PM.t Z := of_class (PM.empty Z) b k.
Definition number_of (b : by_state) (k : nat) (s : state) : Z :=
  match PM.find s (map_of b k) with Some v => v | None => 0 end.

(** What joint states are worth at a step is at most a constant and the prices of their states. *)
Record upper := Upper { u_constant : Z; u_prices : by_state }.

(** A step: the bound of now, whose prices are of the states that are left; earlier ones; what joint
    states are worth at least: a floor and what their states are charged; and what they and those of
    the next step, to which the team moves, are worth at most together: a constant, if there is one,
    and the prices of now. *)
Record step := Step {
  now : upper; earlier : list upper; floor : Z; charges : by_state; with_next : option Z }.
Definition no_step : step := Step (Upper 0 []) [] 0 [] None.

Section Narrowing.
Variables (I : instance) (C : certificate) (coarse : Z).
Notation T := (horizon I).
Notation M := (numbers C).
Notation rs := (all_rows C []).

Definition build_map {B D} (f : state -> B -> option D) (m : PM.t B) : PM.t D :=
  fold_left (fun acc sv => match f (fst sv) (snd sv) with Some v => PM.add (fst sv) v acc | None => acc end)
            (PM.elements m) (PM.empty D).

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
  backward (moves I k) (step_price N k) (toll' k) 0 (map (fun st => map_of (u_prices (now st)) k) N).

Definition first_of {B} (l : list (PM.t B)) : PM.t B := match l with [] => PM.empty B | m :: _ => m end.

(** What the drones of a class get at most, each beside its starts. *)
Definition bests_of (Vs : list (PM.t (option Z))) (k : nat) : list (list state * Z) :=
  map (fun starts => (starts, match best_start (first_of Vs) starts with Some b => b | None => 0 end)) (starts_in k).

(** By how much the constants of a step and of the next one exceed that of the move between them. *)
Definition saved (N : narrowing) (t : nat) : Z :=
  match with_next (at_ N t) with
  | None => 0
  | Some m => Z.max 0 (u_constant (now (at_ N t)) + u_constant (now (at_ N (S t))) - m)
  end.

(** What the moves to a step and from it save. *)
Definition own_saved (N : narrowing) (t : nat) : Z :=
  match t with O => saved N t | S before => saved N before + saved N t end.

Definition total_constant (N : narrowing) : Z := sumZ (map (fun st => u_constant (now st)) N) - total T (saved N).

(** The bound on plans that visit only states that are left; None: there are none. *)
Definition left_bound (N : narrowing) (Vs : list (nat * list (PM.t (option Z)))) : option Z :=
  match team_best (fun k => first_of (of_class [] Vs k)) (team I) with
  | None => None
  | Some v => Some (total_constant N + row_constant C [] + v)
  end.

Definition sweep_all (N : narrowing) : list (nat * list (PM.t (option Z))) :=
  map (fun k => (k, to_go_of N k)) (classes I).

(** The value of the best path into each state, without the state itself, less the value of the drone's
    best path; for the drone of the class for which this difference is largest. *)
Definition sweep_so_far (N : narrowing) (Vs : list (nat * list (PM.t (option Z)))) : list (nat * list (PM.t Z)) :=
  map (fun k => (k, left_forward N k (step_price N k) (toll' k)
                      (map (fun sv => (fst sv, - snd sv)) (bests_of (of_class [] Vs k) k)))) (classes I).

(** Closes states of so much slack that no plan above the target visits them. own: what moves save
    that is no loss of this step. *)
Definition closed_step (target bound own : Z) (so_far : list (nat * list (PM.t Z))) (Vs : list (nat * list (PM.t (option Z))))
  (t : nat) (st : step) : step :=
  let slack k := let V := nth t (of_class [] Vs k) (PM.empty _) in
                 fun s u => match PM.find s V with Some (Some v) => Some (- (u + v)) | _ => None end in
  let of_left (f : nat -> state -> Z -> Z) :=
    map (fun k => (k, build_map (fun s u => match slack k s u with
                                  | Some l => if l <? bound - target then Some (f k s l) else None
                                  | None => None end) (nth t (of_class [] so_far k) (PM.empty Z)))) (classes I) in
  let prices := u_prices (now st) in
  Step (Upper (u_constant (now st)) (of_left (fun k s _ => number_of prices k s))) (earlier st)
       (target - bound + u_constant (now st) - own) (of_left (fun k s l => number_of prices k s + l)) (with_next st).

Fixpoint with_steps {B} (f : nat -> B -> B) (t : nat) (l : list B) : list B :=
  match l with [] => [] | b :: rest => f t b :: with_steps f (S t) rest end.

(** None: no plan is above the target. *)
Definition close (target : Z) (N : narrowing) : option narrowing :=
  let Vs := sweep_all N in
  match left_bound N Vs with
  | None => None
  | Some bound =>
      let so_far := sweep_so_far N Vs in
      Some (with_steps (fun t => closed_step target bound (own_saved N t) so_far Vs t) 0 N)
  end.

Definition staged_numbers_ok : bool :=
  numbers_ok I C [] && negb (over_time M) && (0 <? coarse)
  && forallb (fun k => views_in_reach_ok I C k 0 (in_reach I k)) (classes I).

(** * Soundness *)

Lemma find_build_map {B D} (f : state -> B -> option D) (m : PM.t B) s u v :
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
  intros l. generalize (PM.empty D). induction l as [|[s' u'] l IH]; intros acc Hu Hin; [contradiction|]. simpl.
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

Lemma map_of_map (f : nat -> PM.t Z) k : In k (classes I) -> map_of (map (fun k => (k, f k)) (classes I)) k = f k.
Proof. apply of_class_map. Qed.

Lemma sum_nth {B} (f : B -> Z) (d : B) l : sumZ (map f l) = total (length l) (fun t => f (nth t l d)).
Proof.
  rewrite total_seq. f_equal. induction l as [|b l IH]; [reflexivity|].
  simpl. f_equal. rewrite IH, <- seq_shift, map_map. reflexivity.
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

(** What is paid at a step for the plan's states. *)
Definition paid_now (N : narrowing) (t : nat) : Z := prices_sum (u_prices (now (at_ N t))) t.

(** Constants of moves hold, and no two of them share a step. *)
Definition moves_inv (N : narrowing) : Prop := forall t m, with_next (at_ N t) = Some m ->
  (t < T)%nat /\ with_next (at_ N (S t)) = None /\ (FR t + FR (S t) <= IZR (m + paid_now N t + paid_now N (S t)))%R.

Definition inv (N : narrowing) : Prop :=
  (length N = S T /\ moves_inv N) /\ forall t, (t <= T)%nat -> step_inv t (at_ N t).

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

(** ** What moves save *)

Lemma total_constant_is N : inv N -> total_constant N = total (S T) (fun t => u_constant (now (at_ N t))) - total T (saved N).
Proof.
  intros [[Hlen _] _]. unfold total_constant, at_. rewrite (sum_nth (fun st => u_constant (now st)) no_step), Hlen. reflexivity.
Qed.

Lemma step_at_most N t : inv N -> (t <= T)%nat -> (FR t <= IZR (u_constant (now (at_ N t)) + paid_now N t))%R.
Proof. intros [_ HN] Ht. destruct (HN t Ht) as [_ [HU _]]. exact (HU (now (at_ N t)) (or_introl eq_refl)). Qed.

Lemma saved_ok N t : inv N -> (S t <= T)%nat -> (FR t + FR (S t) <=
  IZR (u_constant (now (at_ N t)) + paid_now N t) + IZR (u_constant (now (at_ N (S t))) + paid_now N (S t)) - IZR (saved N t))%R.
Proof.
  intros HN Ht. pose proof (step_at_most N t HN ltac:(lia)) as H1. pose proof (step_at_most N (S t) HN Ht) as H2.
  unfold saved. destruct (with_next (at_ N t)) as [m|] eqn:E; [|lra].
  destruct HN as [[_ HM] _]. destruct (HM t m E) as [_ [_ Hm]]. rewrite !plus_IZR in *.
  destruct (Z.max_spec 0 (u_constant (now (at_ N t)) + u_constant (now (at_ N (S t))) - m)) as [[_ ->] | [_ ->]];
    rewrite ?minus_IZR, ?plus_IZR; lra.
Qed.

Lemma saved_apart N t : inv N -> saved N t = 0 \/ saved N (S t) = 0.
Proof.
  intros [[_ HM] _]. unfold saved at 1. destruct (with_next (at_ N t)) as [m|] eqn:E; [|left; reflexivity].
  right. destruct (HM t m E) as [_ [E' _]]. unfold saved. rewrite E'. reflexivity.
Qed.

Lemma saved_last N : inv N -> saved N T = 0.
Proof.
  intros [[_ HM] _]. unfold saved. destruct (with_next (at_ N T)) as [m|] eqn:E; [|reflexivity].
  destruct (HM T m E) as [H _]. lia.
Qed.

(** What a plan is worth at some steps in a row. *)
Lemma steps_at_most N a n : inv N -> (a + n <= S T)%nat -> (sumR (map FR (seq a n))
  <= IZR (total n (fun i => u_constant (now (at_ N (a + i)%nat)) + paid_now N (a + i)%nat)%Z - total (pred n) (fun i => saved N (a + i)%nat)))%R.
Proof.
  intros HN Hn. rewrite sumR_from, minus_IZR, (IZR_total n). apply sumR_less.
  - intros i Hi. apply step_at_most; [exact HN | lia].
  - intros i Hi. replace (a + S i)%nat with (S (a + i)) by lia. apply saved_ok; [exact HN | lia].
  - intros i. replace (a + S i)%nat with (S (a + i)) by lia. apply saved_apart, HN.
Qed.

(** The bound on plans that visit only states that are left. *)
Lemma J_left N : inv N -> (J I plan * IZR (precision M)
  <= IZR (total_constant N + row_constant C [] + sumZ (map (worth_of N) plan)))%R.
Proof.
  intros HN. eapply Rle_trans; [apply (J_steps N)|]. pose proof (steps_at_most N 0 (S T) HN (le_n _)) as H.
  rewrite total_add in H. change (total (S T) (fun t => paid_now N (0 + t)%nat)) with (all_prices N) in H.
  change (total (pred (S T)) (fun i => saved N (0 + i)%nat)) with (total T (saved N)) in H.
  change (total (S T) (fun t => u_constant (now (at_ N (0 + t)%nat)))) with (total (S T) (fun t => u_constant (now (at_ N t)))) in H.
  rewrite (total_constant_is N HN). rewrite !plus_IZR, !minus_IZR in *. rewrite !plus_IZR in *. lra.
Qed.

Lemma total_without_own N t : inv N -> (t <= T)%nat ->
  total T (fun i => if (Nat.eqb t i || Nat.eqb t (S i))%bool then 0 else saved N i) = total T (saved N) - own_saved N t.
Proof.
  intros HN Ht. pose proof (saved_last N HN) as Hlast.
  assert (E : total T (saved N) = total T (fun i => if (Nat.eqb t i || Nat.eqb t (S i))%bool then 0 else saved N i)
      + total T (fun i => if Nat.eqb t i then saved N i else 0)
      + total T (fun i => if Nat.eqb t (S i) then saved N i else 0)).
  { rewrite <- !total_add. apply total_ext. intros i _.
    destruct (Nat.eqb_spec t i), (Nat.eqb_spec t (S i)); simpl; lia. }
  rewrite total_pick in E.
  assert (E' : own_saved N t = (if Nat.ltb t T then saved N t else 0) + total T (fun i => if Nat.eqb t (S i) then saved N i else 0)).
  { unfold own_saved. destruct t as [|b].
    - rewrite total_zero by reflexivity. destruct (Nat.ltb_spec 0 T); [lia|]. replace T with O in Hlast by lia. lia.
    - change (fun i => if Nat.eqb (S b) (S i) then saved N i else 0) with (fun i => if Nat.eqb b i then saved N i else 0).
      rewrite total_pick. destruct (Nat.ltb_spec b T); [|lia]. destruct (Nat.ltb_spec (S b) T); [lia|].
      replace (S b) with T by lia. lia. }
  lia.
Qed.

Section Above.
Variable target : Z.
Hypothesis above : (IZR target < J I plan * IZR (precision M))%R.

(** What a plan above the target loses at a step, and on its drones' paths, is less than there is and
    than the moves to the step and from it save. *)
Lemma losses N t : inv N -> (t <= T)%nat ->
  (IZR target < FR t - IZR (u_constant (now (at_ N t)) + paid_now N t) + IZR (own_saved N t)
     + IZR (total_constant N + row_constant C [] + sumZ (map (worth_of N) plan)))%R.
Proof.
  intros HN Ht. eapply Rlt_le_trans; [exact above|]. eapply Rle_trans; [apply (J_steps N)|].
  set (Kp := fun i => u_constant (now (at_ N i)) + paid_now N i).
  (* the other steps have their constants, less what other moves save *)
  pose proof (sumR_less FR (fun i => if Nat.eqb t i then FR i else IZR (Kp i))
    (fun i => if (Nat.eqb t i || Nat.eqb t (S i))%bool then 0 else saved N i) (S T)) as Hsum. cbn [pred] in Hsum.
  rewrite (total_without_own N t HN Ht) in Hsum.
  assert (Ec : (sumR (map (fun i => if Nat.eqb t i then FR i else IZR (Kp i)) (seq 0 (S T))) = IZR (total (S T) Kp) + (FR t - IZR (Kp t)))%R).
  { rewrite IZR_total. assert (X : forall n, sumR (map (fun i => if Nat.eqb t i then FR i else IZR (Kp i)) (seq 0 n))
        = (sumR (map (fun i => IZR (Kp i)) (seq 0 n)) + (if Nat.ltb t n then FR t - IZR (Kp t) else 0))%R).
    { induction n as [|n IH]; [simpl; lra|]. rewrite !sumR_next, IH.
      destruct (Nat.ltb_spec t n), (Nat.ltb_spec t (S n)), (Nat.eqb_spec t n); try lia; try lra. subst n. lra. }
    rewrite X. destruct (Nat.ltb_spec t (S T)); [reflexivity | lia]. }
  assert (EK : total (S T) Kp = total (S T) (fun i => u_constant (now (at_ N i))) + all_prices N) by (unfold Kp; apply total_add).
  rewrite Ec, EK in Hsum. rewrite (total_constant_is N HN). change (u_constant (now (at_ N t)) + paid_now N t) with (Kp t).
  assert (Hle : (sumR (map FR (seq 0 (S T))) <= IZR (total (S T) (fun i => u_constant (now (at_ N i))) + all_prices N) + (FR t - IZR (Kp t))
      - IZR (total T (saved N) - own_saved N t))%R).
  { apply Hsum.
    - intros i Hi. destruct (Nat.eqb t i); [lra | apply step_at_most; [exact HN | lia]].
    - intros i Hi. pose proof (step_at_most N i HN ltac:(lia)) as H1. pose proof (step_at_most N (S i) HN ltac:(lia)) as H2.
      pose proof (saved_ok N i HN ltac:(lia)) as H3. fold (Kp i) in H1, H3. fold (Kp (S i)) in H2, H3.
      destruct (Nat.eqb_spec t i), (Nat.eqb_spec t (S i)); cbn [orb]; lra.
    - intros i. destruct (saved_apart N i HN) as [-> | ->]; [left | right]; match goal with |- (if ?b then _ else _) = _ => destruct b; reflexivity end. }
  clear Hsum Ec EK. rewrite !plus_IZR, !minus_IZR in *. rewrite ?plus_IZR in *. lra.
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

Lemma Forall2_map_seq {A B} (P : B -> nat -> Prop) (g : A -> B) d : forall l n first, length l = n ->
  (forall t, (t < n)%nat -> P (g (nth t l d)) (first + t)%nat) -> Forall2 P (map g l) (seq first n).
Proof.
  induction l as [|x l IH]; intros n first En H; simpl in En; subst n; simpl; constructor.
  - specialize (H O ltac:(lia)). rewrite Nat.add_0_r in H. exact H.
  - apply IH; [reflexivity|]. intros t Ht. specialize (H (S t) ltac:(lia)). rewrite Nat.add_succ_r in H. exact H.
Qed.

Lemma to_go_ok N f : inv N -> In f plan ->
  Forall2 (fun V j => comes_to V (snd f j) (to_go (step_price N (fst f)) (toll' (fst f)) (snd f) (T - j) j))
    (to_go_of N (fst f)) (seq 0 (S T)).
Proof.
  intros [[Hlen _] HN] Hf. destruct (of_plan f Hf) as [starts [Hd [Hs [Ho Hm]]]]. unfold to_go_of.
  apply (backward_ok T (moves I (fst f)) (step_price N (fst f)) (toll' (fst f)) (snd f) Hm T 0); [lia|].
  apply Forall2_map_seq with (d := no_step); [exact Hlen|]. intros t Ht. rewrite Nat.add_0_l.
  destruct (HN t ltac:(lia)) as [HL _]. exact (HL f Hf).
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

(** What a drone collects before a step is at most the value of its best path and that of the sweep. *)
Lemma so_far_ok N d f t : inv N -> paired N d f -> (t <= T)%nat -> exists u,
  PM.find (snd f t) (nth t (of_class [] (sweep_so_far N (sweep_all N)) (fst f)) (PM.empty Z)) = Some u
  /\ so_far (step_price N (fst f)) (toll' (fst f)) (snd f) t <= best_number N d + u.
Proof.
  destruct d as [k starts]. intros HN [[Ek [Hs [b [Eb Hb]]]] [Hd Hf]] Ht. simpl in Ek, Hs.
  assert (Ego : of_class [] (sweep_all N) (fst f) = to_go_of N (fst f)) by (apply of_class_map, class_in, Hf).
  pose proof (left_forward_ok N f (step_price N (fst f)) (toll' (fst f)) (starts, - b) (- b) HN Hf Hs eq_refl
     (map (fun sv => (fst sv, - snd sv)) (bests_of (to_go_of N (fst f)) (fst f)))) as HW.
  assert (Hin : In (starts, - b) (map (fun sv => (fst sv, - snd sv)) (bests_of (to_go_of N (fst f)) (fst f)))).
  { apply in_map_iff. exists (starts, b). split; [reflexivity|]. rewrite Ek. apply bests_in; [exact Hd | exact Eb]. }
  specialize (HW Hin).
  destruct (Forall2_seq_nth _ (PM.empty _) _ _ _ HW t ltac:(lia)) as [u [Eu Hu]]. rewrite Nat.add_0_l in Eu, Hu.
  exists u. split.
  - unfold sweep_so_far. rewrite (of_class_map [] (fun k => left_forward N k (step_price N k) (toll' k)
        (map (fun sv => (fst sv, - snd sv)) (bests_of (of_class [] (sweep_all N) k) k)))) by (apply class_in, Hf).
    rewrite Ego. exact Eu.
  - assert (En : best_number N (k, starts) = b) by (unfold best_number; rewrite Eb; reflexivity). rewrite En. lia.
Qed.

(** ** Closing *)

Lemma close_ok N : inv N -> exists N', close target N = Some N' /\ inv N'.
Proof.
  intros HN. unfold close. destruct (team_best_is N HN) as [EB Hworths]. rewrite EB.
  set (B := total_constant N + row_constant C [] + sumZ (map (best_number N) (team I))) in *.
  eexists. split; [reflexivity|]. cbv zeta. set (into := sweep_so_far N (sweep_all N)).
  set (N' := with_steps _ 0 N). pose proof HN as [[Hlen Hmoves] Hsteps].
  assert (Hat : forall t, (t <= T)%nat -> at_ N' t = closed_step target B (own_saved N t) into (sweep_all N) t (at_ N t)).
  { intros t Ht. unfold at_, N'. rewrite with_steps_nth by lia. reflexivity. }
  enough (Hclosed : forall t, (t <= T)%nat -> step_inv t (at_ N' t) /\ paid_now N' t = paid_now N t).
  { split; [split|]; [unfold N'; rewrite with_steps_length; exact Hlen | | intros; apply Hclosed; assumption].
    intros t m E. destruct (Nat.le_gt_cases t T) as [Ht | Ht].
    - rewrite Hat in E by exact Ht. destruct (Hmoves t m E) as [H1 [H2 H3]]. split; [exact H1|]. split; [rewrite Hat by lia; exact H2|].
      rewrite !(fun t Ht => proj2 (Hclosed t Ht)) by lia. exact H3.
    - unfold at_, N' in E. rewrite nth_overflow in E by (rewrite with_steps_length; lia). discriminate. }
  intros t Ht. unfold paid_now. rewrite (Hat t Ht).
  set (st := at_ N t). destruct (Hsteps t Ht) as [HL [HU HF]].
  pose proof (losses N t HN Ht) as Hloss. pose proof (J_left N HN) as Hleft. unfold paid_now in Hloss. fold st in Hloss, HL, HU, HF.
  set (own := own_saved N t) in *.
  set (slack_of := fun f : flight => match PM.find (snd f t) (nth t (of_class [] into (fst f)) (PM.empty Z)),
      PM.find (snd f t) (nth t (of_class [] (sweep_all N) (fst f)) (PM.empty _)) with
      | Some u, Some (Some v) => - (u + v) | _, _ => 0 end).
  (* the slack of a drone's state is no more than what its path loses *)
  assert (Hslack : forall d f, paired N d f -> (exists u v,
      PM.find (snd f t) (nth t (of_class [] into (fst f)) (PM.empty Z)) = Some u
      /\ PM.find (snd f t) (nth t (of_class [] (sweep_all N) (fst f)) (PM.empty _)) = Some (Some v))
      /\ slack_of f <= best_number N d - worth_of N f /\ worth_of N f <= best_number N d).
  { intros d f Hp. destruct (so_far_ok N d f t HN Hp Ht) as [u [Eu Hu]].
    destruct Hp as [[_ [_ [b [Eb Hb]]]] [_ Hf]].
    assert (Ego : of_class [] (sweep_all N) (fst f) = to_go_of N (fst f)) by (apply of_class_map, class_in, Hf).
    pose proof (to_go_ok N f HN Hf) as HV.
    destruct (Forall2_seq_nth _ (PM.empty _) _ _ _ HV t ltac:(lia)) as [v [Ev Hv]]. rewrite Nat.add_0_l in Ev, Hv. rewrite <- Ego in Ev.
    split; [exists u, v; split; assumption|].
    assert (En : best_number N d = b) by (unfold best_number; rewrite Eb; reflexivity). rewrite En in *.
    fold into in Eu. unfold slack_of. rewrite Eu, Ev.
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
  assert (Hroom : forall f, In f plan -> slack_of f < B - target).
  { intros f Hf. specialize (Heach f Hf). apply lt_IZR.
    apply IZR_le in Heach. rewrite ?plus_IZR, ?minus_IZR in *. unfold B. rewrite !plus_IZR. lra. }
  assert (Hkept : forall (h : nat -> state -> Z -> Z) f, In f plan ->
    PM.find (snd f t) (map_of (map (fun k => (k, build_map (fun s u =>
         match (match PM.find s (nth t (of_class [] (sweep_all N) k) (PM.empty _)) with Some (Some v) => Some (- (u + v)) | _ => None end) with
         | Some l => if l <? B - target then Some (h k s l) else None
         | None => None end) (nth t (of_class [] into k) (PM.empty Z)))) (classes I)) (fst f)) = Some (h (fst f) (snd f t) (slack_of f))).
  { intros h f Hf.
    pose proof (paired_of N f HN Hf) as Hd.
    destruct Hd as [d Hp]. destruct (Hslack d f Hp) as [[u [v [Eu Ev]]] _].
    rewrite map_of_map by (apply class_in, Hf).
    apply find_build_map with (u := u); [exact Eu|]. rewrite Ev.
    assert (Es : slack_of f = - (u + v)) by (unfold slack_of; rewrite Eu, Ev; reflexivity).
    rewrite Es. pose proof (Hroom f Hf) as Hr. rewrite Es in Hr. apply Z.ltb_lt in Hr. rewrite Hr. reflexivity. }
  assert (Hnumbers : forall (h : nat -> state -> Z -> Z),
    prices_sum (map (fun k => (k, build_map (fun s u =>
         match (match PM.find s (nth t (of_class [] (sweep_all N) k) (PM.empty _)) with Some (Some v) => Some (- (u + v)) | _ => None end) with
         | Some l => if l <? B - target then Some (h k s l) else None
         | None => None end) (nth t (of_class [] into k) (PM.empty Z)))) (classes I)) t
    = sumZ (map (fun f => h (fst f) (snd f t) (slack_of f)) plan)).
  { intros h. unfold prices_sum. apply sumZ_ext. intros f Hf. unfold number_of. rewrite (Hkept h f Hf). reflexivity. }
  unfold closed_step. cbv zeta. fold K. split; [split; [|split]|].
  - intros f Hf. simpl. eexists. apply (Hkept (fun k s _ => number_of (u_prices (now st)) k s) f Hf).
  - simpl. intros u [<- | Hu].
    + simpl. rewrite (Hnumbers (fun k s _ => number_of (u_prices (now st)) k s)). exact Hnow.
    + apply HU. right. exact Hu.
  - simpl. rewrite (Hnumbers (fun k s l => number_of (u_prices (now st)) k s + l)).
    rewrite sumZ_add. change (sumZ (map (fun f => number_of (u_prices (now st)) (fst f) (snd f t)) plan)) with P.
    clear Hkept Hnumbers Heach Hroom Hsums Hleft. set (slacks := sumZ (map slack_of plan)) in Htogether.
    change (sumZ (map _ plan)) with slacks. set (worths := sumZ (map (worth_of N) plan)) in *.
    set (bests := sumZ (map (best_number N) (team I))) in *.
    apply IZR_le in Htogether. unfold B. rewrite ?plus_IZR, ?minus_IZR in *. rewrite ?plus_IZR, ?minus_IZR in *.
    rewrite ?plus_IZR in *. lra.
  - exact (Hnumbers (fun k s _ => number_of (u_prices (now st)) k s)).
Qed.

End Above.
End Plan.
End Narrowing.
