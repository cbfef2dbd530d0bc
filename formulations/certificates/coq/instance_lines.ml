(* Reads the lines of an instance (docs/reference/instances.md), or refuses them.

   This is believed, as Build.v is. What cocap-check refuses of an instance is refused here, too. *)
module Big = Z
open Checker
module Z = Big

exception Refused of string

let refuse format = Printf.ksprintf (fun message -> raise (Refused message)) format

let require condition message = if not condition then raise (Refused message)

let words line = List.filter (( <> ) "") (String.split_on_char ' ' line)

let lines_of name =
  let file = open_in_bin name in
  let rec all acc = match input_line file with
    | line -> all (line :: acc)
    | exception End_of_file -> close_in file; List.rev acc in
  all []

let whole word =
  if word = "" || not (String.for_all (fun c -> c >= '0' && c <= '9') word) then refuse "no whole number: %s" word
  else Z.of_string word

(* A power of two, as doubles have it. *)
let power_of word =
  let sign, digits = match word with
    | "" -> (1, "")
    | _ when word.[0] = '+' || word.[0] = '-' ->
      ((if word.[0] = '-' then -1 else 1), String.sub word 1 (String.length word - 1))
    | _ -> (1, word) in
  if String.length digits > 4 then refuse "no double: p%s" word else sign * Z.to_int (whole digits)

(* A hexadecimal number as (m, bits): m / 2^bits, bits >= 0.  It must be a double. *)
let dyadic word =
  match String.split_on_char 'p' word with
  | [digits; power] when String.length digits > 2 && String.sub digits 0 2 = "0x" ->
    let power = power_of power in
    let digits = String.sub digits 2 (String.length digits - 2) in
    let before, after = match String.split_on_char '.' digits with
      | [b] -> b, ""
      | [b; a] -> b, a
      | _ -> refuse "no number: %s" word in
    let is_digit c = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F') in
    if not (String.for_all is_digit (before ^ after)) then refuse "no hexadecimal number: %s" word;
    let m = Z.of_string_base 16 (before ^ after) and bits = 4 * String.length after - power in
    let odd = if Z.equal m Z.zero then m else Z.shift_right m (Z.trailing_zeros m) in
    if Z.numbits odd > 53 || Z.numbits m - bits > 1024 || bits - (Z.numbits m - Z.numbits odd) > 1074 then
      refuse "no double: %s" word;
    let zeros = if Z.equal m Z.zero then max bits 0 else min (Z.trailing_zeros m) (max bits 0) in
    let m = Z.shift_right m zeros and bits = bits - zeros in
    if bits >= 0 then (m, Z.of_int bits) else (Z.shift_left m (-bits), Z.zero)
  | _ -> refuse "no hexadecimal number >= 0: %s" word

let signed word =
  if word <> "" && word.[0] = '-' then
    let m, bits = dyadic (String.sub word 1 (String.length word - 1)) in (Z.neg m, bits)
  else dyadic word

let flag = function "0" -> false | "1" -> true | word -> refuse "must be 0 or 1: %s" word

let pair separator first second word =
  match String.index_opt word separator with
  | None -> refuse "no pair: %s" word
  | Some i -> (first (String.sub word 0 i), second (String.sub word (i + 1) (String.length word - i - 1)))

let move word =
  let n = String.length word in
  if n > 0 && word.[n - 1] = '=' then (whole (String.sub word 0 (n - 1)), true) else (whole word, false)

type known = {
  mutable drone_numbers : Z.t list;
  mutable capped : Z.t list;           (* groups whose weight has a k *)
  mutable layers : Z.t list list;      (* of each kind, of each place among those of its drones *)
  mutable of_head : (string * string list) list;
  mutable k_weights : (Z.t * ((Z.t * Z.t) * Z.t)) list;
  mutable k_kinds : kind_lines list;
  mutable k_classes : class_lines list;
}

let change_kind known f =
  match known.k_kinds with
  | kind :: rest -> known.k_kinds <- f kind :: rest
  | [] -> refuse "there is no kind yet"

let change_class known f =
  match known.k_classes with
  | last :: rest -> known.k_classes <- f last :: rest
  | [] -> refuse "there is no class yet"

let rec split_at_colon before = function
  | [] -> (List.rev before, None)
  | ":" :: after -> (List.rev before, Some after)
  | word :: rest -> split_at_colon (word :: before) rest

let read_line known line =
  let before, after = split_at_colon [] (words line) in
  match before, after with
  | "scene" :: _, _ -> ()
  | ("digest" | "coverage" | "horizon" | "groups" | "rewards" | "rules" as word) :: rest, None ->
    if List.mem_assoc word known.of_head then refuse "%s is there twice" word;
    known.of_head <- (word, rest) :: known.of_head
  | ["weight"; g; w], None -> known.k_weights <- (whole g, (dyadic w, Z.one)) :: known.k_weights
  | ["weight"; g; w; k], None ->
    known.capped <- whole g :: known.capped;
    known.k_weights <- (whole g, (dyadic w, whole k)) :: known.k_weights
  | ["kind"], None ->
    known.layers <- [] :: known.layers;
    known.k_kinds <- { orientations = []; places = []; closed_places = []; closed_moves = []; sights = [] } :: known.k_kinds
  | ["orientation"; h; p], Some turns ->
    change_kind known (fun k -> { k with orientations = ((whole h, whole p), List.map whole turns) :: k.orientations })
  | ["place"; x; y; own; m; a; b; c], Some heads ->
    (match known.layers with
     | of_kind :: rest -> known.layers <- (whole own :: of_kind) :: rest
     | [] -> refuse "there is no kind yet");
    let position = ((signed a, signed b), signed c) in
    let place = { x = whole x; y = whole y; layer = whole m; position; heads = List.map move heads } in
    change_kind known (fun k -> { k with places = place :: k.places })
  | ["closed"; t; q], None ->
    change_kind known (fun k -> { k with closed_places = (whole t, whole q) :: k.closed_places })
  | ["closed"; t; q; r], None ->
    change_kind known (fun k -> { k with closed_moves = (whole t, (whole q, whole r)) :: k.closed_moves })
  | ["sees"; t; q; o], Some views ->
    let sight = (((whole t, whole q), whole o), List.map (pair ':' whole dyadic) views) in
    change_kind known (fun k -> { k with sights = sight :: k.sights })
  | ["class"; k], goal ->
    let goal = Option.map (List.map whole) goal in
    known.k_classes <- { kind_of = whole k; goal; drones = [] } :: known.k_classes
  | ["drone"; number], Some starts ->
    known.drone_numbers <- whole number :: known.drone_numbers;
    change_class known (fun c -> { c with drones = List.map (pair ',' whole whole) starts :: c.drones })
  | _ -> refuse "it says nothing that is known"

(* -- what must hold of the lines together ------------------------------------------------------- *)

(* Refuses what is there twice. *)
let once message items =
  let met = Hashtbl.create (2 * List.length items) in
  List.iter (fun item -> require (not (Hashtbl.mem met item)) message; Hashtbl.add met item ()) items

let int_of z = if Z.fits_int z then Z.to_int z else refuse "too large: %s" (Z.to_string z)

let below n z = Z.sign z >= 0 && Z.lt z (Z.of_int n)

let is_number value (m, bits) = Z.equal m (Z.shift_left (Z.of_int value) (Z.to_int bits))

let position_key ((a, b), c) = List.map (fun (m, bits) -> (Z.to_string m, Z.to_int bits)) [a; b; c]

let check_kind lines at layers (kind : kind_lines) =
  let n = List.length kind.places and turns = List.length kind.orientations in
  let n_roots = Z.mul lines.face_rows lines.faces in
  let is_step t = Z.leq t lines.last_step and is_place = below n in
  let cells = List.map (fun p -> (Z.to_string p.x, Z.to_string p.y, Z.to_string p.layer)) kind.places in
  once "place: a cell is there twice" cells;
  once "place: a layer of a cell is there twice"
    (List.map2 (fun p layer -> List.map Z.to_string [p.x; p.y; layer]) kind.places layers);
  List.iter2 (fun cell p ->
      let here = position_key p.position in
      require (Option.value (Hashtbl.find_opt at cell) ~default:here = here) "place: a cell is at two positions";
      Hashtbl.replace at cell here) cells kind.places;
  List.iter (fun p ->
      require (List.for_all (fun (head, _) -> is_place head) p.heads) "place: a move leads nowhere";
      once "place: a move is there twice" (List.map (fun (head, _) -> int_of head) p.heads)) kind.places;
  once "orientation: one is there twice" (List.map (fun ((h, p), _) -> (Z.to_string h, Z.to_string p)) kind.orientations);
  List.iter (fun (_, turned) -> require (List.for_all (below turns) turned) "orientation: a turn leads nowhere") kind.orientations;
  List.iter (fun (t, q) -> require (is_step t && is_place q) "closed: no such place") kind.closed_places;
  List.iter (fun (t, (q, r)) -> require (is_step t && is_place q && is_place r) "closed: no such place") kind.closed_moves;
  once "sees: a state is there twice"
    (List.map (fun (((t, q), o), _) -> (int_of t, int_of q, int_of o)) kind.sights);
  List.iter (fun (((t, q), o), views) ->
      require (is_step t && is_place q && below turns o) "sees: no such state";
      once "sees: a group is there twice" (List.map (fun (g, _) -> int_of g) views);
      List.iter (fun (g, amount) ->
          let is_root = Z.lt g n_roots in
          let row = if is_root && Z.equal lines.face_rows Z.one then Z.zero else t in
          let first, width = if is_root then (Z.zero, lines.faces) else (n_roots, lines.people) in
          let start = Z.add first (Z.mul row width) in
          require (Z.leq start g && Z.lt g (Z.add start width)) "sees: a group of another step";
          require (if is_root then Z.sign (fst amount) > 0 else is_number 1 amount) "sees: wrong amount") views) kind.sights

let check known lines =
  require (Z.sign lines.last_step > 0) "horizon: must be 1 or more";
  require (Z.equal lines.face_rows Z.one || Z.equal lines.face_rows (Z.succ lines.last_step)) "groups: wrong rows";
  require (lines.vertex || not (lines.swap || Z.sign (fst lines.distance) > 0)) "rules: vertex must be 1";
  let n_roots = Z.mul lines.face_rows lines.faces in
  let n_groups = Z.add n_roots (Z.mul (Z.succ lines.last_step) lines.people) in
  once "weight: a group is there twice" (List.map (fun (g, _) -> int_of g) lines.weights);
  List.iter (fun (g, (_, k)) ->
      require (Z.lt g n_groups) "weight: no such group";
      require (Z.geq g n_roots = List.exists (Z.equal g) known.capped) "weight: k only of counts";
      require (Z.sign k > 0) "weight: k must be 1 or more") lines.weights;
  let at = Hashtbl.create 1000 in
  List.iter2 (check_kind lines at) (List.rev_map List.rev known.layers) lines.kinds;
  let kinds = Array.of_list lines.kinds in
  List.iter (fun (c : class_lines) ->
      require (below (Array.length kinds) c.kind_of && c.drones <> []) "class: no such kind, or no drones";
      let kind = kinds.(Z.to_int c.kind_of) in
      let is_place = below (List.length kind.places) and is_turn = below (List.length kind.orientations) in
      require (List.for_all is_place (Option.value c.goal ~default:[])) "class: a goal is no place";
      List.iter (fun starts ->
          require (starts <> [] && List.for_all (fun (p, o) -> is_place p && is_turn o) starts) "drone: no such start")
        c.drones) lines.class_list;
  let numbers = List.sort Z.compare known.drone_numbers in
  require (List.for_all2 Z.equal numbers (List.init (List.length numbers) Z.of_int)) "drones: must be 0, 1, .."

let instance name =
  let known = { drone_numbers = []; capped = []; layers = []; of_head = []; k_weights = []; k_kinds = []; k_classes = [] } in
  let rec go number = function
    | ["end"] -> ()
    | [] | "end" :: _ -> refuse "line %d: the last line must be: end" number
    | line :: rest ->
      (try read_line known line with Refused message -> refuse "line %d: %s" number message);
      go (number + 1) rest in
  (match lines_of name with
   | "cocap-instance 1" :: rest -> go 2 rest
   | _ -> refuse "line 1: must be cocap-instance 1");
  let head word = match List.assoc_opt word known.of_head with
    | Some rest -> rest
    | None -> refuse "there is no line: %s" word in
  let kinds = List.rev_map (fun k -> { k with orientations = List.rev k.orientations; places = List.rev k.places })
      known.k_kinds in
  let class_list = List.rev_map (fun c -> { c with drones = List.rev c.drones }) known.k_classes in
  (match head "digest", head "coverage" with
   | [_], [version] -> ignore (whole version)
   | _ -> refuse "digest and coverage must have one word each");
  match head "horizon", head "groups", head "rewards", head "rules" with
  | [t], [rows; faces; people], [still; cell; heading; even], [v; w; d; z] ->
    let lines = { last_step = whole t; face_rows = whole rows; faces = whole faces; people = whole people;
      still = dyadic still; same_cell = dyadic cell; same_heading = dyadic heading; balanced = dyadic even;
      vertex = flag v; swap = flag w; distance = dyadic d; height = dyadic z;
      weights = known.k_weights; kinds; class_list } in
    check known lines;
    lines
  | _ -> refuse "horizon, groups, rewards and rules must have 1, 3, 4 and 4 numbers"
