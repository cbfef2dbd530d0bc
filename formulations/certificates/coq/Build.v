(** From the lines of an instance to what they mean.  This is believed, as Spec is. *)
From Coq Require Import ZArith QArith List Bool FMapPositive.
From CocapCheck Require Import Spec.
Import ListNotations.
Open Scope Z_scope.
Module PM := PositiveMap.

(** m / 2^bits, bits >= 0 *)
Definition dyadic : Type := Z * Z.

Record place_line := PlaceLine {
  x : Z; y : Z; layer : Z;           (* layer among all *)
  position : dyadic * dyadic * dyadic;
  heads : list (Z * bool)            (* places a step later; balanced *)
}.

Record kind_lines := KindLines {
  orientations : list (Z * Z * list Z);            (* heading, tilt, turns *)
  places : list place_line;
  closed_places : list (Z * Z);                    (* step, place *)
  closed_moves : list (Z * (Z * Z));               (* step, from, to *)
  sights : list (Z * Z * Z * list (Z * dyadic))    (* step, place, orientation; group, amount *)
}.

Record class_lines := ClassLines {
  kind_of : Z; goal : option (list Z); drones : list (list (Z * Z)) }.

Record lines := Lines {
  last_step : Z; face_rows : Z; faces : Z; people : Z;
  still : dyadic; same_cell : dyadic; same_heading : dyadic; balanced : dyadic;
  vertex : bool; swap : bool; distance : dyadic; height : dyadic;
  weights : list (Z * (dyadic * Z));               (* group, weight, k *)
  kinds : list kind_lines;
  class_list : list class_lines
}.

(** * Numbers and tables *)

Definition bits_of (l : list dyadic) : Z := fold_left (fun b d => Z.max b (snd d)) l 0.
Definition in_bits (bits : Z) (d : dyadic) : Z := fst d * 2 ^ (bits - snd d).

Definition key (z : Z) : positive := Z.to_pos (z + 1).

Fixpoint numbered {A} (n : Z) (l : list A) : list (Z * A) :=
  match l with [] => [] | a :: l' => (n, a) :: numbered (n + 1) l' end.

Definition table {A} (l : list (Z * A)) : PM.t A :=
  fold_left (fun m a => PM.add (key (fst a)) (snd a) m) l (PM.empty A).

Definition tables {A} (l : list (Z * A)) : PM.t (list A) :=
  fold_left (fun m a => let k := key (fst a) in
    PM.add k (snd a :: match PM.find k m with Some old => old | None => [] end) m) l (PM.empty _).

Definition get {A} (default : A) (m : PM.t A) (k : positive) : A :=
  match PM.find k m with Some a => a | None => default end.

Definition has {A} (m : PM.t A) (k : positive) : bool :=
  match PM.find k m with Some _ => true | None => false end.

(** * Conflicts of two drones: cells and, in millionths of 1/2^bits m, positions of both ends *)

Definition point : Type := Z * Z * Z.
Record end_of := End { cell : Z * Z * Z; at_ : point }.

Definition same_cell_as (a b : end_of) : bool :=
  let '(xa, ya, za) := cell a in let '(xb, yb, zb) := cell b in (xa =? xb) && (ya =? yb) && (za =? zb).

Definition minus (p q : point) : point :=
  let '(a, b, c) := p in let '(d, e, f) := q in (a - d, b - e, c - f).

Definition Qltb (a b : Q) : bool := negb (Qle_bool b a).
Definition Qlarger (a b : Q) : Q := if Qle_bool a b then b else a.
Definition Qsmaller (a b : Q) : Q := if Qle_bool a b then a else b.

(** On the way from [before] to [after], as one drone sees the other: are both nearer than [aside],
    seen from above if [above] is there, and then less than that apart in height? *)
Definition too_near (aside : Z) (above : option Z) (before after : point) : bool :=
  let '(bx, by_, bz) := before in
  let '(wx, wy, wz) := minus after before in
  let nearest low high flat :=
    let square := wx * wx + wy * wy + flat * (wz * wz) in
    let best := if square =? 0 then low
                else Qsmaller (Qlarger (inject_Z (- (bx * wx + by_ * wy + flat * (bz * wz))) / inject_Z square) low) high in
    let coordinate b w := (inject_Z b + best * inject_Z w)%Q in
    let px := coordinate bx wx in let py := coordinate by_ wy in let pz := coordinate bz wz in
    Qltb (px * px + py * py + inject_Z flat * (pz * pz)) (inject_Z (aside * aside)) in
  match above with
  | None => nearest 0%Q 1%Q 1
  | Some a =>
      if wz =? 0 then (Z.abs bz <? a) && nearest 0%Q 1%Q 0
      else
        let e1 := (inject_Z (- a - bz) / inject_Z wz)%Q in
        let e2 := (inject_Z (a - bz) / inject_Z wz)%Q in
        let first := Qsmaller e1 e2 in let second := Qlarger e1 e2 in
        let low := Qlarger 0 first in let high := Qsmaller 1 second in
        Qltb first high && Qltb low second && Qle_bool low high && nearest low high 0
  end.

Record rules := Rules { r_vertex : bool; r_swap : bool; r_aside : option Z; r_above : option Z }.

Definition conflict (R : rules) (tail head tail' head' : end_of) : bool :=
  (r_vertex R && (same_cell_as tail tail' || same_cell_as head head'))
  || (r_swap R && same_cell_as tail head' && same_cell_as head tail')
  || match r_aside R with
     | None => false
     | Some aside => too_near aside (r_above R) (minus (at_ tail') (at_ tail)) (minus (at_ head') (at_ head))
     end.

(** * One kind *)

Record kind_tables := KindTables {
  n_orientations : Z;
  ends : PM.t end_of;                           (* of places *)
  headings : PM.t Z;                            (* of orientations *)
  even : PM.t (PM.t unit);                      (* places: balanced moves to others *)
  next_states : PM.t (list state);
  shut : PM.t (PM.t unit);                      (* steps: places *)
  barred : PM.t (PM.t (PM.t unit));             (* steps: from: to *)
  seen_from : PM.t (PM.t (list (group * Z)))    (* steps: states *)
}.

Definition state_key (n place turn : Z) : state := key (place * n + turn).
Definition place_in (K : kind_tables) (s : state) : Z := (Zpos s - 1) / n_orientations K.
Definition turn_in (K : kind_tables) (s : state) : Z := (Zpos s - 1) mod n_orientations K.

Definition point_in (bits : Z) (p : dyadic * dyadic * dyadic) : point :=
  let '(a, b, c) := p in let f d := in_bits bits d * 1000000 in (f a, f b, f c).

Definition marks (l : list Z) : PM.t unit := table (map (fun z => (z, tt)) l).

Definition kind_of_lines (amount_bits length_bits : Z) (k : kind_lines) : kind_tables :=
  let n := Z.of_nat (length (orientations k)) in
  let turns := numbered 0 (map snd (orientations k)) in
  let here := numbered 0 (places k) in
  KindTables n
    (table (map (fun ip => (fst ip, End (x (snd ip), y (snd ip), layer (snd ip)) (point_in length_bits (position (snd ip))))) here))
    (table (numbered 0 (map (fun o => fst (fst o)) (orientations k))))
    (table (map (fun ip => (fst ip, marks (map fst (filter snd (heads (snd ip)))))) here))
    (table (flat_map (fun ip => map (fun it =>
        (fst ip * n + fst it,
         flat_map (fun h => map (fun turn => state_key n (fst h) turn) (snd it)) (heads (snd ip)))) turns) here))
    (PM.map marks (tables (closed_places k)))
    (PM.map (fun l => PM.map marks (tables l)) (tables (closed_moves k)))
    (PM.map table (tables (map (fun e => let '(t, p, o, l) := e in
        (t, (p * n + o, map (fun gc => (key (fst gc), in_bits amount_bits (snd gc))) l))) (sights k)))).

Definition no_kind : kind_tables :=
  KindTables 1 (PM.empty _) (PM.empty _) (PM.empty _) (PM.empty _) (PM.empty _) (PM.empty _) (PM.empty _).

Definition step_key (t : nat) : positive := Pos.of_succ_nat t.

Definition is_open (last : nat) (K : kind_tables) (goals : option (PM.t unit)) (t : nat) : state -> bool :=
  let closed := get (PM.empty _) (shut K) (step_key t) in
  fun s =>
    let p := key (place_in K s) in
    negb (has closed p)
    && (negb (Nat.eqb t last) || match goals with None => true | Some g => has g p end).

Definition moves_from (K : kind_tables) (t : nat) (s : state) : list state :=
  let all := get [] (next_states K) s in
  match PM.find (step_key t) (barred K) with
  | None => all
  | Some from => match PM.find (key (place_in K s)) from with
                 | None => all
                 | Some to => filter (fun s' => negb (has to (key (place_in K s')))) all
                 end
  end.

(** * The instance *)

Definition all_views (L : lines) : list dyadic :=
  flat_map (fun k => flat_map (fun e => map snd (snd e)) (sights k)) (kinds L).

Definition all_lengths (L : lines) : list dyadic :=
  distance L :: height L :: flat_map (fun k => flat_map (fun p =>
    let '(a, b, c) := position p in [a; b; c]) (places k)) (kinds L).

Definition all_values (L : lines) : list dyadic :=
  [still L; same_cell L; same_heading L; balanced L] ++ map (fun w => fst (snd w)) (weights L).

(** Each drone a class, so that a certificate may tell them apart: the same plans. *)
Definition apart_classes (cs : list class_lines) : list class_lines :=
  flat_map (fun c => map (fun d => ClassLines (kind_of c) (goal c) [d]) (drones c)) cs.

Definition build (single : bool) (L : lines) : instance :=
  let cs := if single then apart_classes (class_list L) else class_list L in
  let T := Z.to_nat (last_step L) in
  let amount_bits := bits_of (all_views L) in
  let value_bits := bits_of (all_values L) in
  let length_bits := bits_of (all_lengths L) in
  let kind_table := table (numbered 0 (map (kind_of_lines amount_bits length_bits) (kinds L))) in
  let classes := table (numbered 0 (map (fun c =>
    (get no_kind kind_table (key (kind_of c)), option_map marks (goal c))) cs)) in
  let of_class k := get (no_kind, None) classes (step_key k) in
  let metres d := in_bits length_bits d * 1000000 - 2 ^ length_bits in   (* less 1e-6 m *)
  let R := Rules (vertex L) (swap L)
    (if fst (distance L) =? 0 then None else Some (metres (distance L)))
    (if fst (height L) =? 0 then None else Some (metres (height L))) in
  let nowhere := End (0, 0, 0) (0, 0, 0) in
  let end_at k p := get nowhere (ends (fst (of_class k))) p in
  let value := in_bits value_bits in
  let rewarded := negb ((fst (still L) =? 0) && (fst (same_cell L) =? 0)
                        && (fst (same_heading L) =? 0) && (fst (balanced L) =? 0)) in
  let n_faces := face_rows L * faces L in
  let weight_table := table (map (fun w => (fst w, value (fst (snd w)))) (weights L)) in
  let k_table := table (map (fun w => (fst w, snd (snd w))) (weights L)) in
  {| horizon := T;
     team := flat_map (fun kc => map (fun starts =>
         (Z.to_nat (fst kc), map (fun po => state_key (n_orientations (fst (of_class (Z.to_nat (fst kc))))) (fst po) (snd po)) starts))
         (drones (snd kc))) (numbered 0 cs);
     open := fun k t => is_open T (fst (of_class k)) (snd (of_class k)) t;
     moves := fun k => moves_from (fst (of_class k));
     bonus := fun k =>
       if rewarded then
         let K := fst (of_class k) in
         fun s s' =>
           let p := place_in K s in let q := place_in K s' in
           let heading s := get 0 (headings K) (key (turn_in K s)) in
           (if Pos.eqb s s' then value (still L) else 0)
           + (if p =? q then value (same_cell L) else 0)
           + (if heading s =? heading s' then value (same_heading L) else 0)
           + (if has (get (PM.empty _) (even K) (key p)) (key q) then value (balanced L) else 0)
       else fun _ _ => 0;
     place := fun k s => key (place_in (fst (of_class k)) s);
     meet := fun a =>
       let e := end_at (fst a) (snd a) in
       fun b => let e' := end_at (fst b) (snd b) in conflict R e e e' e';
     clash := fun a b =>
       let '(k, p, q) := a in let '(k', p', q') := b in
       conflict R (end_at k p) (end_at k q) (end_at k' p') (end_at k' q');
     sees := fun k t =>
       let at_step := get (PM.empty _) (seen_from (fst (of_class k))) (step_key t) in
       fun s => get [] at_step s;
     n_groups := Z.to_nat (n_faces + (last_step L + 1) * people L);
     weight := fun g => get 0 weight_table g;
     return_by := fun g => if Zpos g <=? n_faces then Root else AtMost (get 1 k_table g);
     amount_unit := 2 ^ amount_bits;
     weight_unit := 2 ^ value_bits |}.
