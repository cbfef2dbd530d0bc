(** Pools: how many drones of a class are left, and the states that they may take.

    Numbers of states add up to a bound on their sum for any drones that are left. What has too low
    a number, with the best of all others beside it, is dropped. *)
From Coq Require Import ZArith List Bool Lia.
From CocapCheck Require Import Spec Sums Sweep.
Import ListNotations.
Open Scope Z_scope.

Definition pool (A : Type) : Type := list (nat * list A).

(** What drones of a class get at most of a number: a level each, and something together. *)
Definition cover : Type := Z * Z.

Section Pools.
Context {B : Type}.
Variable meets : B -> B -> bool.   (* in conflict: no two drones take them *)

Definition most_of (f : B -> Z) (l : list B) : option Z := largest (fun b => Some (f b)) l None.

(** The largest number as a level. *)
Definition by_most (f : B -> Z) (n : nat) (l : list B) : option cover :=
  match most_of f l with None => None | Some m => Some (m, 0) end.

(** States two by two in conflict, and what the best of them is above a level. *)
Fixpoint join (b : B) (e : Z) (cliques : list (list B * Z)) : list (list B * Z) :=
  match cliques with
  | [] => [([b], e)]
  | (members, m) :: rest =>
      if forallb (meets b) members then (b :: members, Z.max m e) :: rest else (members, m) :: join b e rest
  end.

Definition cliques (f : B -> Z) (level : Z) (l : list B) : list (list B * Z) :=
  fold_left (fun cs b => join b (f b - level) cs) l [].

(** A lower level, and what is above it: of states two by two in conflict one is taken at most.  The
    level may be any number; it is used where it bounds n drones by less. *)
Definition by_level (level : Z) (f : B -> Z) (n : nat) (l : list B) : option cover :=
  match most_of f l with
  | None => None
  | Some m =>
      let high := filter (fun b => level <? f b) l in
      if (level <? m) && forallb (fun b => meets b b) high then
        let extra := sumZ (map snd (cliques f level high)) in
        Some (if extra <? Z.of_nat n * (m - level) then (level, extra) else (m, 0))
      else Some (m, 0)
  end.

(** Of each class, by a way to cover it. *)
Fixpoint covers_by (ways : list (nat -> list B -> option cover)) (p : pool B) {struct p} : option (list cover) :=
  match p, ways with
  | [], _ => Some []
  | (n, l) :: rest, way :: ways' =>
      match way n l, covers_by ways' rest with
      | Some c, Some cs => Some (c :: cs)
      | _, _ => None
      end
  | _, [] => None
  end.

Fixpoint most_together (p : pool B) (cs : list cover) : Z :=
  match p, cs with
  | (n, _) :: rest, (level, extra) :: cs' => Z.of_nat n * level + extra + most_together rest cs'
  | _, _ => 0
  end.

Fixpoint keep_each (f : B -> Z) (room : Z) (p : pool B) (cs : list cover) : pool B :=
  match p, cs with
  | (n, l) :: rest, (level, _) :: cs' => let least := level - room in
      (n, filter (fun b => least <? f b) l) :: keep_each f room rest cs'
  | _, _ => []
  end.

(** Drops what is in no completion whose sum of f, and the base, is above a threshold. *)
Definition keep_by (ways : list (nat -> list B -> option cover)) (threshold base : Z) (f : B -> Z) (p : pool B) : option (pool B) :=
  match covers_by ways p with
  | None => None
  | Some cs => let room := base + most_together p cs - threshold in
      if room <=? 0 then None else Some (keep_each f room p cs)
  end.

Definition mosts (f : B -> Z) (p : pool B) : option (list cover) := covers_by (map (fun _ => by_most f) p) p.

Definition keep (threshold base : Z) (f : B -> Z) (p : pool B) : option (pool B) :=
  keep_by (map (fun _ => by_most f) p) threshold base f p.

(** * Soundness *)

Definition completes (p : pool B) (Ls : list (list B)) : Prop :=
  Forall2 (fun nl L => length L = fst nl /\ incl L (snd nl)) p Ls.
Definition positive_counts (p : pool B) : Prop := Forall (fun nl => (1 <= fst nl)%nat) p.
Definition drones_left (p : pool B) : nat := fold_right (fun nl n => (fst nl + n)%nat) O p.
Definition within (p p' : pool B) : Prop := Forall2 (fun a b => fst a = fst b /\ incl (snd a) (snd b)) p p'.

(** No two states of a list are in conflict. *)
Definition no_two_meet (L : list B) : Prop := ForallOrdPairs (fun a b => meets a b = false) L.

Definition covered (f : B -> Z) (c : cover) (l : list B) : Prop :=
  forall L, incl L l -> no_two_meet L -> sumZ (map f L) <= Z.of_nat (length L) * fst c + snd c.

(** A way to cover does so, wherever there is a state. *)
Definition way_ok (f : B -> Z) (way : nat -> list B -> option cover) : Prop :=
  forall n l, (exists b, In b l) -> exists c, way n l = Some c /\ covered f c l.

Lemma most_of_ok (f : B -> Z) l b : In b l -> exists m, most_of f l = Some m /\ f b <= m.
Proof. intros H. exact (largest_in (fun b => Some (f b)) l None b (f b) H eq_refl). Qed.

Lemma most_times (f : B -> Z) (m : Z) L : (forall b, In b L -> f b <= m) -> sumZ (map f L) <= Z.of_nat (length L) * m.
Proof.
  induction L as [|b L IH]; intros H; [simpl; lia|]. cbn [map sumZ length]. rewrite Nat2Z.inj_succ.
  pose proof (H b (or_introl eq_refl)). specialize (IH (fun c Hc => H c (or_intror Hc))). lia.
Qed.

Lemma most_covers (f : B -> Z) l m : (forall b, In b l -> f b <= m) -> covered f (m, 0) l.
Proof. intros H L Hin _. simpl. pose proof (most_times f m L (fun b Hb => H b (Hin b Hb))). lia. Qed.

Lemma most_of_all (f : B -> Z) l : (exists b, In b l) -> exists m, most_of f l = Some m /\ forall b, In b l -> f b <= m.
Proof.
  intros [a Ha]. destruct (most_of_ok f l a Ha) as [m [Em _]]. exists m. split; [exact Em|].
  intros b Hb. destruct (most_of_ok f l b Hb) as [m' [Em' Hb']]. congruence.
Qed.

Lemma by_most_ok f : way_ok f (by_most f).
Proof.
  intros n l Hl. destruct (most_of_all f l Hl) as [m [Em Hm]]. exists (m, 0). unfold by_most. rewrite Em.
  split; [reflexivity | apply most_covers, Hm].
Qed.

(** ** Sets of states in conflict *)

Hypothesis meets_symmetric : forall a b, meets a b = meets b a.

Definition is_clique (c : list B * Z) : Prop := 0 <= snd c /\ forall a b, In a (fst c) -> In b (fst c) -> meets a b = true.

Lemma join_ok b e cs : 0 <= e -> meets b b = true -> Forall is_clique cs ->
  Forall is_clique (join b e cs)
  /\ (exists c, In c (join b e cs) /\ In b (fst c) /\ e <= snd c)
  /\ (forall a x, (exists c, In c cs /\ In a (fst c) /\ x <= snd c) -> exists c, In c (join b e cs) /\ In a (fst c) /\ x <= snd c).
Proof.
  intros He Hb. induction 1 as [|[members m] cs Hc Hcs IH]; cbn [join].
  - split; [|split].
    + constructor; [|constructor]. split; [exact He|]. intros x y [<- | []] [<- | []]. exact Hb.
    + exists ([b], e). simpl. auto with zarith.
    + intros a x [c [[] _]].
  - destruct (forallb (meets b) members) eqn:E.
    + rewrite forallb_forall in E. destruct Hc as [Hm Hc]. simpl in Hm, Hc. split; [|split].
      * constructor; [|exact Hcs]. split; simpl; [lia|]. intros x y [<- | Hx] [<- | Hy]; auto.
        rewrite meets_symmetric. auto.
      * exists (b :: members, Z.max m e). simpl. split; [auto|]. split; [auto | lia].
      * intros a x [c [[<- | Hin] [Ha Hx]]]; simpl in Ha, Hx.
        -- exists (b :: members, Z.max m e). simpl. split; [auto|]. split; [auto | lia].
        -- exists c. simpl. auto.
    + destruct IH as [IH1 [IH2 IH3]]. split; [|split].
      * constructor; assumption.
      * destruct IH2 as [c [Hc1 Hc2]]. exists c. split; [right; exact Hc1 | exact Hc2].
      * intros a x [c [[<- | Hin] Ha]].
        -- exists (members, m). split; [left; reflexivity | exact Ha].
        -- destruct (IH3 a x (ex_intro _ c (conj Hin Ha))) as [c' [Hc1 Hc2]]. exists c'. split; [right; exact Hc1 | exact Hc2].
Qed.

Lemma cliques_ok f level high : (forall b, In b high -> level < f b /\ meets b b = true) ->
  Forall is_clique (cliques f level high)
  /\ forall b, In b high -> exists c, In c (cliques f level high) /\ In b (fst c) /\ f b - level <= snd c.
Proof.
  unfold cliques. intros H.
  assert (X : forall l cs, (forall b, In b l -> level < f b /\ meets b b = true) -> Forall is_clique cs ->
    Forall is_clique (fold_left (fun cs b => join b (f b - level) cs) l cs)
    /\ (forall b, In b l -> exists c, In c (fold_left (fun cs b => join b (f b - level) cs) l cs) /\ In b (fst c) /\ f b - level <= snd c)
    /\ (forall a x, (exists c, In c cs /\ In a (fst c) /\ x <= snd c) ->
         exists c, In c (fold_left (fun cs b => join b (f b - level) cs) l cs) /\ In a (fst c) /\ x <= snd c)).
  { induction l as [|b l IH]; intros cs Hl Hcs; [repeat split; auto; intros b []|]. simpl.
    destruct (Hl b (or_introl eq_refl)) as [Hb Hbb].
    destruct (join_ok b (f b - level) cs ltac:(lia) Hbb Hcs) as [J1 [J2 J3]].
    destruct (IH (join b (f b - level) cs) (fun x Hx => Hl x (or_intror Hx)) J1) as [I1 [I2 I3]].
    split; [exact I1|]. split.
    - intros x [<- | Hx]; [apply I3, J2 | apply I2, Hx].
    - intros a x Ha. apply I3, J3, Ha. }
  destruct (X high [] H (Forall_nil _)) as [X1 [X2 _]]. auto.
Qed.

Lemma cliques_sum (g : B -> Z) L : no_two_meet L -> forall cs, Forall is_clique cs ->
  (forall b, In b L -> g b <= 0 \/ exists c, In c cs /\ In b (fst c) /\ g b <= snd c) ->
  sumZ (map g L) <= sumZ (map snd cs).
Proof.
  induction 1 as [|a L Ha H IH]; intros cs Hcs Hin; simpl.
  - apply sumZ_nonneg. intros c Hc. rewrite Forall_forall in Hcs. apply (Hcs c Hc).
  - destruct (Hin a (or_introl eq_refl)) as [Hneg | [c [Hc [Hac Hg]]]].
    + specialize (IH cs Hcs (fun b Hb => Hin b (or_intror Hb))). lia.
    + destruct (in_split c cs Hc) as [c1 [c2 ->]].
      rewrite map_app, sumZ_app. simpl.
      enough (sumZ (map g L) <= sumZ (map snd (c1 ++ c2))) as E by (rewrite map_app, sumZ_app in E; lia).
      apply Forall_app in Hcs. destruct Hcs as [H1 H2]. apply Forall_cons_iff in H2. destruct H2 as [H2 H3].
      apply IH; [apply Forall_app; auto|]. intros b Hb. destruct (Hin b (or_intror Hb)) as [Hneg | [c' [Hc' [Hbc Hg']]]]; [auto|].
      right. apply in_app_iff in Hc'. destruct Hc' as [Hc' | [<- | Hc']].
      * exists c'. split; [apply in_app_iff; auto | auto].
      * exfalso. rewrite Forall_forall in Ha. specialize (Ha b Hb). destruct H2 as [_ H2]. rewrite (H2 a b Hac Hbc) in Ha. discriminate.
      * exists c'. split; [apply in_app_iff; auto | auto].
Qed.

Lemma by_level_ok level f : way_ok f (by_level level f).
Proof.
  intros n l Hl. destruct (most_of_all f l Hl) as [m [Em Hm]]. unfold by_level. rewrite Em. cbv zeta.
  pose proof (most_covers f l m Hm) as Hmost.
  destruct ((level <? m) && forallb (fun b => meets b b) (filter (fun b => level <? f b) l)) eqn:E; [|exists (m, 0); auto].
  match goal with |- context [if ?b then (level, _) else _] => destruct b end; [|exists (m, 0); auto].
  eexists. split; [reflexivity|]. apply andb_true_iff in E. destruct E as [_ E]. rewrite forallb_forall in E.
  set (high := filter (fun b => level <? f b) l) in *.
  assert (Hhigh : forall b, In b high -> level < f b /\ meets b b = true).
  { intros b Hb. split; [|apply E, Hb]. unfold high in Hb. apply filter_In in Hb. destruct Hb as [_ Hb]. apply Z.ltb_lt, Hb. }
  destruct (cliques_ok f level high Hhigh) as [C1 C2].
  intros L Hin Hfits.
  change (sumZ (map f L) <= Z.of_nat (length L) * level + sumZ (map snd (cliques f level high))).
  pose proof (cliques_sum (fun b => f b - level) L Hfits _ C1) as HS.
  assert (Ediff : sumZ (map (fun b => f b - level) L) = sumZ (map f L) - Z.of_nat (length L) * level).
  { clear. induction L as [|b L IH]; [reflexivity|]. cbn [map sumZ length]. rewrite Nat2Z.inj_succ, IH. lia. }
  rewrite Ediff in HS. enough (sumZ (map f L) - Z.of_nat (length L) * level <= sumZ (map snd (cliques f level high))) by lia.
  apply HS. intros b Hb. destruct (Z.leb_spec (f b - level) 0) as [Hle | Hgt]; [left; exact Hle|]. right.
  apply C2. unfold high. apply filter_In. split; [apply Hin, Hb | apply Z.ltb_lt; lia].
Qed.

(** ** Keeping *)

Lemma covers_ok (f : B -> Z) ways (p : pool B) Ls : completes p Ls -> positive_counts p ->
  length ways = length p -> Forall (way_ok f) ways -> Forall no_two_meet Ls ->
  exists cs, covers_by ways p = Some cs
    /\ Forall2 (fun c nl => covered f c (snd nl)) cs p
    /\ sumZ (map f (concat Ls)) <= most_together p cs.
Proof.
  intros Hc. revert ways. induction Hc as [|[n l] L p Ls [Hlen Hin] H IH]; intros ways Hp Hways Hok Hfits.
  - exists []. split; [reflexivity|]. split; [constructor | simpl; lia].
  - apply Forall_cons_iff in Hp. destruct Hp as [Hn Hp]. simpl in Hn, Hlen, Hin.
    destruct ways as [|way ways]; [discriminate|]. apply Forall_cons_iff in Hok, Hfits.
    destruct Hok as [Hw Hok], Hfits as [HL Hfits]. simpl in Hways.
    destruct (IH ways Hp ltac:(lia) Hok Hfits) as [cs [Ecs [Hcs Hsum]]].
    destruct L as [|b L]; [simpl in Hlen; lia|].
    destruct (Hw n l (ex_intro _ b (Hin b (or_introl eq_refl)))) as [c [Ec Hcov]].
    exists (c :: cs). cbn [covers_by]. rewrite Ec, Ecs. split; [reflexivity|]. split; [constructor; assumption|].
    cbn [concat]. rewrite map_app, sumZ_app. destruct c as [level extra]. cbn [most_together].
    pose proof (Hcov _ Hin HL) as HC. cbn [fst snd] in HC. rewrite Hlen in HC. lia.
Qed.

(** With one of its members at f b, what a completion adds up to is less than the most by level - f b. *)
Lemma keep_each_ok (f : B -> Z) room (p : pool B) : forall Ls cs before,
  completes p Ls -> Forall2 (fun c nl => covered f c (snd nl)) cs p -> Forall no_two_meet Ls ->
  before + most_together p cs - sumZ (map f (concat Ls)) < room -> 0 <= before ->
  completes (keep_each f room p cs) Ls.
Proof.
  induction p as [|[n l] p IH]; intros Ls cs before Hc Hm Hfits Hroom Hb; inversion Hc as [|? L ? Ls' [Hlen Hin] Hc']; subst; inversion Hm as [|[level extra] ? cs' ? Hcov Hm']; subst.
  - constructor.
  - apply Forall_cons_iff in Hfits. destruct Hfits as [HL Hfits].
    cbn [keep_each]. simpl in Hlen, Hin, Hcov. cbn [most_together concat] in Hroom. rewrite map_app, sumZ_app in Hroom.
    assert (Hrest : 0 <= most_together p cs' - sumZ (map f (concat Ls'))).
    { clear - Hc' Hm' Hfits. revert cs' Hm'. induction Hc' as [|[n l] L p Ls [Hlen Hin] H IH]; intros cs Hm; inversion Hm as [|[level extra] ? cs' ? Hcov Hm']; subst.
      - simpl. lia.
      - apply Forall_cons_iff in Hfits. destruct Hfits as [HL Hfits].
        cbn [most_together concat]. rewrite map_app, sumZ_app. specialize (IH Hfits cs' Hm').
        pose proof (Hcov L Hin HL) as HC. simpl in Hlen, HC. rewrite Hlen in HC. lia. }
    pose proof (Hcov L Hin HL) as HC. simpl in HC. rewrite Hlen in HC.
    constructor.
    + split; [exact Hlen|]. simpl. intros b Hb'. apply filter_In. split; [apply Hin, Hb'|]. apply Z.ltb_lt.
      (* the others of this class are covered, too *)
      enough (sumZ (map f L) <= (Z.of_nat n - 1) * level + extra + f b) by lia.
      destruct (in_split b L Hb') as [L1 [L2 EL]]. subst L. rewrite map_app, sumZ_app. simpl.
      assert (H12 : no_two_meet (L1 ++ L2)).
      { clear - HL. unfold no_two_meet in *. induction L1 as [|x L1 IH]; simpl in *; inversion HL as [|? ? Hx HL']; subst; [exact HL'|].
        constructor; [|apply IH, HL']. apply Forall_app in Hx. destruct Hx as [Hx1 Hx2]. apply Forall_cons_iff in Hx2. apply Forall_app. tauto. }
      pose proof (Hcov (L1 ++ L2) ltac:(intros x Hx; apply Hin; apply in_app_iff in Hx; apply in_app_iff; simpl; tauto) H12) as HC2.
      simpl in HC2. rewrite map_app, sumZ_app in HC2. rewrite app_length in HC2, Hlen. simpl in Hlen.
      replace (Z.of_nat n - 1) with (Z.of_nat (length L1 + length L2)) by lia. lia.
    + apply (IH Ls' cs' (before + (Z.of_nat n * level + extra - sumZ (map f L)))); try assumption; lia.
Qed.

Lemma keep_each_within (f : B -> Z) room (p : pool B) : forall cs, length cs = length p -> within (keep_each f room p cs) p.
Proof.
  induction p as [|[n l] p IH]; intros [|[level extra] cs] H; try discriminate; cbn [keep_each]; constructor.
  - split; [reflexivity|]. apply incl_filter.
  - apply IH. simpl in H. lia.
Qed.

Lemma keep_by_ok ways threshold base (f : B -> Z) (p : pool B) Ls :
  completes p Ls -> positive_counts p -> length ways = length p -> Forall (way_ok f) ways -> Forall no_two_meet Ls ->
  threshold < base + sumZ (map f (concat Ls)) ->
  exists p', keep_by ways threshold base f p = Some p' /\ completes p' Ls /\ within p' p.
Proof.
  intros Hc Hp Hlen Hok Hfits Ht. destruct (covers_ok f ways p Ls Hc Hp Hlen Hok Hfits) as [cs [Ecs [Hcs Hsum]]].
  unfold keep_by. rewrite Ecs. cbv zeta.
  destruct (Z.leb_spec (base + most_together p cs - threshold) 0) as [L | L]; [lia|].
  eexists. split; [reflexivity|]. split.
  - apply (keep_each_ok f _ p Ls cs 0); try assumption; lia.
  - apply keep_each_within, (Forall2_lengths _ _ _ Hcs).
Qed.

Lemma all_by_most f (p : pool B) : length (map (fun _ => by_most f) p) = length p /\ Forall (way_ok f) (map (fun _ => by_most f) p).
Proof.
  rewrite map_length. split; [reflexivity|]. apply Forall_forall. intros way Hw.
  apply in_map_iff in Hw. destruct Hw as [_ [<- _]]. apply by_most_ok.
Qed.

Lemma mosts_ok (f : B -> Z) (p : pool B) Ls : completes p Ls -> positive_counts p -> Forall no_two_meet Ls ->
  exists cs, mosts f p = Some cs /\ sumZ (map f (concat Ls)) <= most_together p cs.
Proof.
  intros Hc Hp Hfits. destruct (all_by_most f p) as [H1 H2].
  destruct (covers_ok f _ p Ls Hc Hp H1 H2 Hfits) as [cs [Ecs [_ Hsum]]]. exists cs. auto.
Qed.

Lemma keep_ok threshold base (f : B -> Z) (p : pool B) Ls :
  completes p Ls -> positive_counts p -> Forall no_two_meet Ls -> threshold < base + sumZ (map f (concat Ls)) ->
  exists p', keep threshold base f p = Some p' /\ completes p' Ls /\ within p' p.
Proof. intros Hc Hp Hfits Ht. destruct (all_by_most f p) as [H1 H2]. apply keep_by_ok; assumption. Qed.

Lemma within_counts (p p' : pool B) : within p p' -> positive_counts p' -> positive_counts p.
Proof.
  induction 1 as [|a b p p' [E _] H IH]; intros Hp; [constructor|].
  apply Forall_cons_iff in Hp. destruct Hp. constructor; [rewrite E; assumption | apply IH; assumption].
Qed.

Lemma within_left (p p' : pool B) : within p p' -> drones_left p = drones_left p'.
Proof. induction 1 as [|a b p p' [E _] H IH]; simpl; [reflexivity|]. rewrite E, IH. reflexivity. Qed.

Lemma within_trans (p q r : pool B) : within p q -> within q r -> within p r.
Proof.
  intros H. revert r. induction H as [|a b p q [E I0] H IH]; intros r Hr; inversion Hr as [|? c ? r' [E' I'] Hr']; subst; constructor.
  - split; [congruence | eapply incl_tran; eassumption].
  - apply IH. assumption.
Qed.

Lemma within_refl (p : pool B) : within p p.
Proof. induction p; constructor; [split; [reflexivity | apply incl_refl] | assumption]. Qed.
End Pools.
