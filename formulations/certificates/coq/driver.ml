(* cocap-check-verified INSTANCE LOWERED: reads both files and asks the extracted checker.

   What is believed of this file: [instance], which reads the lines of an instance, and that the
   claim that is printed is the claim that was checked.  A certificate that is read wrongly can only
   be refused. *)
module Big = Z
open Checker
module Z = Big

exception Refused of string

let refuse format = Printf.ksprintf (fun message -> raise (Refused message)) format

let words line = List.filter (( <> ) "") (String.split_on_char ' ' line)

let lines_of name =
  let file = open_in_bin name in
  let rec all acc = match input_line file with
    | line -> all (line :: acc)
    | exception End_of_file -> close_in file; List.rev acc in
  all []

(* -- the instance: this is believed ------------------------------------------------------------ *)

let whole word =
  if word = "" || not (String.for_all (fun c -> c >= '0' && c <= '9') word) then refuse "no whole number: %s" word
  else Z.of_string word

(* A hexadecimal number as (m, bits): m / 2^bits, bits >= 0. *)
let dyadic word =
  match String.split_on_char 'p' word with
  | [digits; power] when String.length digits > 2 && String.sub digits 0 2 = "0x" ->
    let power = int_of_string (if power.[0] = '+' then String.sub power 1 (String.length power - 1) else power) in
    let digits = String.sub digits 2 (String.length digits - 2) in
    let before, after = match String.split_on_char '.' digits with
      | [b] -> b, ""
      | [b; a] -> b, a
      | _ -> refuse "no number: %s" word in
    let m = Z.of_string_base 16 (before ^ after) and bits = 4 * String.length after - power in
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
  | ["weight"; g; w; k], None -> known.k_weights <- (whole g, (dyadic w, whole k)) :: known.k_weights
  | ["kind"], None ->
    known.k_kinds <- { orientations = []; places = []; closed_places = []; closed_moves = []; sights = [] } :: known.k_kinds
  | ["orientation"; h; p], Some turns ->
    change_kind known (fun k -> { k with orientations = ((whole h, whole p), List.map whole turns) :: k.orientations })
  | ["place"; x; y; own; m; a; b; c], Some heads ->
    ignore (whole own);
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
  | ["drone"; _], Some starts ->
    change_class known (fun c -> { c with drones = List.map (pair ',' whole whole) starts :: c.drones })
  | _ -> refuse "it says nothing that is known"

let instance name =
  let known = { of_head = []; k_weights = []; k_kinds = []; k_classes = [] } in
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
  match head "horizon", head "groups", head "rewards", head "rules" with
  | [t], [rows; faces; people], [still; cell; heading; even], [v; w; d; z] ->
    { last_step = whole t; face_rows = whole rows; faces = whole faces; people = whole people;
      still = dyadic still; same_cell = dyadic cell; same_heading = dyadic heading; balanced = dyadic even;
      vertex = flag v; swap = flag w; distance = dyadic d; height = dyadic z;
      weights = known.k_weights; kinds; class_list }
  | _ -> refuse "horizon, groups, rewards and rules must have 1, 3, 4 and 4 numbers"

(* -- the certificate, lowered to whole numbers: a wrong reading is refused ---------------------- *)

type source = { file : in_channel; mutable left : string list }

let rec word source =
  match source.left with
  | w :: rest -> source.left <- rest; w
  | [] -> source.left <- words (input_line source.file); word source

let z source = Z.of_string (word source)
let n source = int_of_string (word source)
let is source = flag (word source)

let many source item =
  let rec go k acc = if k = 0 then List.rev acc else let x = item source in go (k - 1) (x :: acc) in
  go (n source) []

let number source = let k = n source in let p = z source in (k, p)

let resource source =
  match word source with
  | "at" -> let t = n source in At (t, many source number)
  | "visit" -> let t = n source in Visit (t, many source number)
  | "moving" -> let t = n source in
    Moving (t, many source (fun s -> let from = number s in let p = z s in (from, p)))
  | w -> refuse "no resource: %s" w

let cut source =
  let share = z source in let constant = z source in
  let curves = many source (fun s -> let k = n s in
    (k, many s (fun s -> let r = z s in let v = z s in (r, v)))) in
  { share; constant; curves }

let group source =
  let g = z source in let alpha = z source in let beta = z source in let kappa = z source in
  let at_step = n source in let cuts = many source cut in
  (g, { alpha; beta; kappa; cuts; at_step })

let certificate source =
  let scale = z source in let precision = z source in let over_time = is source in
  let table = Hashtbl.create 1000 in
  List.iter (fun (g, prices) -> Hashtbl.replace table g prices) (many source group);
  let others = { alpha = scale; beta = scale; kappa = Z.zero; cuts = []; at_step = 0 } in
  let prices g = match Hashtbl.find_opt table g with Some p -> p | None -> others in
  let rules = many source (fun s -> let used = resource s in
    { used; at_most = true; count = Z.one; multiplier = z s }) in
  { numbers = { scale; precision; over_time; prices }; rules }

let rec tree source =
  match word source with
  | "leaf" -> let c = certificate source in Proved (c, many source z)
  | "branch" -> let r = resource source in let k = z source in
    let most = tree source in let least = tree source in Divided (r, k, most, least)
  | w -> refuse "no leaf and no branch: %s" w

let stage source =
  let payments = many source (fun s ->
      let t = n s in let k = n s in
      let listed = many s (fun s -> let state = z s in (state, z s)) in
      ((t, k), (listed, z s))) in
  { payments; step_constants = many source (fun s -> let t = n s in (t, z s)) }

let rec leaves = function Proved _ -> 1 | Divided (_, _, a, b) -> leaves a + leaves b

(* A fraction with six digits, rounded up. *)
let decimals numerator denominator =
  let million = Z.of_int 1_000_000 in
  let scaled = Z.cdiv (Z.mul numerator million) denominator in
  Printf.sprintf "%s%s.%06d" (if Z.sign scaled < 0 then "-" else "")
    (Z.to_string (Z.div (Z.abs scaled) million)) (Z.to_int (Z.rem (Z.abs scaled) million))

let () =
  let exit_with code message = print_endline message; exit code in
  if Array.length Sys.argv <> 3 then exit_with 2 "usage: cocap-check-verified INSTANCE LOWERED";
  match
    let lines = instance Sys.argv.(1) in
    let source = { file = open_in Sys.argv.(2); left = [] } in
    if word source <> "cocap-lowered" || n source <> 1 then refuse "must begin with cocap-lowered 1";
    let single = is source in
    let numerator = z source in let denominator = z source in
    let holds, by = match word source with
      | "tree" ->
        let proof = tree source in
        let by = Printf.sprintf "%d leaves" (leaves proof) in
        (check_tree (build single lines) [] proof numerator denominator, by)
      | "staged" ->
        let target = z source in let coarse = z source in
        let first = certificate source in
        let stages = many source stage in
        let paths_above = match word source with "-" -> None | above -> Some (Z.of_string above) in
        let by = Printf.sprintf "%d stages%s" (List.length stages)
            (if paths_above = None then "" else ", and paths of all drones together") in
        let advise = Advice.advise ~coarse ~alone:lines.vertex in
        (check_staged (build single lines) first coarse advise Advice.nothing target stages paths_above numerator denominator, by)
      | w -> refuse "no tree and no stages: %s" w in
    (holds, numerator, denominator, by)
  with
  | true, numerator, denominator, by ->
    exit_with 0 (Printf.sprintf "no plan has more than %s / %s, that is %s (%s)"
                   (Z.to_string numerator) (Z.to_string denominator) (decimals numerator denominator) by)
  | false, _, _, _ -> exit_with 1 "refused: the claim does not follow from the certificate's numbers"
  | exception Refused message -> exit_with 1 ("refused: " ^ message)
  | exception (End_of_file | Failure _ | Invalid_argument _ | Sys_error _ | Not_found as error) ->
    exit_with 1 ("refused: " ^ Printexc.to_string error)
