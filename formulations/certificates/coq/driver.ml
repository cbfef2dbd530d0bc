(* cocap-check-verified [--most-nodes N] [--time-limit SECONDS] INSTANCE LOWERED: reads both files and
   asks the extracted checker.

   What is believed of this file: that the claim that is printed is the claim that was checked, of the
   instance that Instance_lines has read.  A certificate that is read wrongly can only be refused. *)
module Big = Z
open Checker
open Instance_lines
module Z = Big

(* -- the certificate, lowered to whole numbers: a wrong reading is refused ---------------------- *)

type source = { file : in_channel; mutable left : string list }

let rec word source =
  match source.left with
  | w :: rest -> source.left <- rest; w
  | [] -> source.left <- words (input_line source.file); word source

let z source =
  let w = word source in
  if w <> "" && w.[0] = '-' then Z.neg (whole (String.sub w 1 (String.length w - 1))) else whole w
let n source = int_of (whole (word source))

(* Refuses words that follow what was read. *)
let nothing_more source =
  match word source with
  | w -> refuse "it does not end where it must, but with: %s" w
  | exception End_of_file -> ()
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
  { share; constant; phis = Curves curves }

let state_cut source =
  let share = z source in let constant = z source in let knee = z source in
  let sets = many source (fun s -> many s (fun s ->
      let place = number s in let value = z s in (place, value))) in
  { share; constant; phis = States (knee, sets) }

let group source =
  let g = z source in let alpha = z source in let beta = z source in let kappa = z source in
  let at_step = n source in let curves = many source cut in
  let cuts = curves @ many source state_cut in
  (g, { alpha; beta; kappa; cuts; at_step })

let certificate source =
  let scale = z source in let precision = z source in let over_time = is source in
  let table = Hashtbl.create 1000 in
  List.iter (fun (g, prices) ->
      require (not (Hashtbl.mem table g)) "a group is there twice";
      Hashtbl.replace table g prices) (many source group);
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

(* [last], [classes]: the last step, and how many classes there are. *)
let stage last classes source =
  let settings = many source (fun s ->
      let t = n s in
      require (t <= last) "stage: there is no such step";
      let payments = many s (fun s ->
          let k = n s in
          require (k < classes) "stage: there is no such class";
          let listed = many s (fun s -> let state = z s in (state, z s)) in
          (k, (listed, z s))) in
      { of_step = t; payments; claim = z s }) in
  let moves_claimed = many source (fun s ->
      let t = n s in
      require (t < last) "stage: no move begins at this step";
      (t, z s)) in
  { settings; moves_claimed }

let rec leaves = function Proved _ -> 1 | Divided (_, _, a, b) -> leaves a + leaves b

(* A fraction with six digits, rounded up. *)
let decimals numerator denominator =
  let million = Z.of_int 1_000_000 in
  let scaled = Z.cdiv (Z.mul numerator million) denominator in
  Printf.sprintf "%s%s.%06d" (if Z.sign scaled < 0 then "-" else "")
    (Z.to_string (Z.div (Z.abs scaled) million)) (Z.to_int (Z.rem (Z.abs scaled) million))

(* -- limits, and a word now and then -------------------------------------------------------------- *)

exception Too_long of string

let every = 15. (* seconds between two lines of progress, on the standard error *)

let watch_no_more () = Sys.set_signal Sys.sigalrm Sys.Signal_ignore

(* Counts the nodes of searches, those that are cheaply left out aside: each asks for advice.  An
   exception ends the program, so that nothing is claimed. *)
let counted most nodes advise =
  let last = ref [] in
  fun specs seen constants pool memory ->
    if not (!last == seen) then begin
      last := seen;
      incr nodes;
      if !nodes > most then raise (Too_long (Printf.sprintf "its searches take more than %d nodes" most))
    end;
    advise specs seen constants pool memory

(* Looks at the clock once a second, until it ends the check: a second end would find nobody who expects it. *)
let watch seconds nodes =
  let begun = Unix.gettimeofday () in
  let said = ref 0. in
  let look _ =
    let spent = Unix.gettimeofday () -. begun in
    if spent > seconds then begin
      watch_no_more ();
      raise (Too_long (Printf.sprintf "it takes more than %g s" seconds))
    end;
    if spent -. !said > every then begin
      said := spent;
      Printf.eprintf "cocap-check-verified: %.0f s, %d nodes\n%!" spent !nodes
    end in
  Sys.set_signal Sys.sigalrm (Sys.Signal_handle look);
  let first = Float.max 0.001 (Float.min 1. seconds) in
  ignore (Unix.setitimer Unix.ITIMER_REAL { Unix.it_interval = first; it_value = first })

(* -- the claim ------------------------------------------------------------------------------------- *)

(* Whether the claim of a file holds, what it claims, and by what. *)
let checked most seconds instance_file lowered_file =
  let nodes = ref 0 in
  watch seconds nodes;
  let lines = instance instance_file in
  let source = { file = open_in lowered_file; left = [] } in
  if word source <> "cocap-lowered" || n source <> 5 then refuse "must begin with cocap-lowered 5";
  let single = is source in
  let numerator = z source in let denominator = z source in
  let holds, by = match word source with
    | "tree" ->
      let proof = tree source in
      nothing_more source;
      (check_tree (build single lines) [] proof numerator denominator, Printf.sprintf "%d leaves" (leaves proof))
    | "staged" ->
      let target = z source in let coarse = z source in
      let first = certificate source in
      let drones (c : class_lines) = if single then List.length c.drones else 1 in
      let classes = List.fold_left (fun n c -> n + drones c) 0 lines.class_list in
      let stages = many source (stage (int_of lines.last_step) classes) in
      let paths_above = match word source with
        | "-" -> None
        | above -> Some (z { source with left = [above] }) in
      let paths_from = match word source with
        | "-" -> 0
        | from -> n { source with left = [from] } in
      nothing_more source;
      let by = Printf.sprintf "%d stages%s%s" (List.length stages)
          (if paths_above = None then "" else ", and paths of all drones together")
          (if paths_from = 0 then "" else Printf.sprintf ", from step %d" paths_from) in
      let advise = counted most nodes (Advice.advise ~coarse ~alone:lines.vertex) in
      (check_staged (build single lines) first coarse advise Advice.nothing target stages paths_above paths_from
         numerator denominator, by)
    | w -> refuse "no tree and no stages: %s" w in
  watch_no_more ();
  (holds, numerator, denominator, by)

(* Begins again with the largest stack that is allowed: lists of a large instance need a deep one. *)
let deepen () =
  if Sys.getenv_opt "COCAP_CHECK_IS_DEEP" = None then begin
    Unix.putenv "COCAP_CHECK_IS_DEEP" "1";
    let script = "ulimit -S -s \"$(ulimit -H -s)\" 2>/dev/null; exec \"$@\"" in
    let given = Array.sub Sys.argv 1 (Array.length Sys.argv - 1) in
    try Unix.execv "/bin/sh" (Array.append [| "sh"; "-c"; script; "sh"; Sys.executable_name |] given)
    with Unix.Unix_error _ -> ()
  end

let usage = "usage: cocap-check-verified [--most-nodes N] [--time-limit SECONDS] INSTANCE LOWERED"

let () =
  deepen ();
  Gc.set { (Gc.get ()) with Gc.minor_heap_size = 1 lsl 20; space_overhead = 200 };
  let exit_with code message = watch_no_more (); print_endline message; exit code in
  let rec parsed most seconds = function
    | "--most-nodes" :: value :: rest -> (match int_of_string_opt value with
        | Some most when most >= 0 -> parsed most seconds rest
        | _ -> exit_with 2 (Printf.sprintf "--most-nodes: must be a whole number >= 0, not %s" value))
    | "--time-limit" :: value :: rest -> (match float_of_string_opt value with
        | Some seconds when seconds > 0. -> parsed most seconds rest
        | _ -> exit_with 2 (Printf.sprintf "--time-limit: must be a number of seconds > 0, not %s" value))
    | [("-h" | "--help")] -> exit_with 0 usage
    | [first; second] when first.[0] <> '-' && second.[0] <> '-' -> (most, seconds, first, second)
    | _ -> exit_with 2 usage in
  let most, seconds, instance_file, lowered_file = parsed max_int infinity (List.tl (Array.to_list Sys.argv)) in
  match checked most seconds instance_file lowered_file with
  | true, numerator, denominator, by ->
    exit_with 0 (Printf.sprintf "no plan has more than %s / %s, that is %s (%s)"
                   (Z.to_string numerator) (Z.to_string denominator) (decimals numerator denominator) by)
  | false, _, _, _ -> exit_with 1 "refused: the claim does not follow from the certificate's numbers"
  | exception Too_long message -> exit_with 3 ("not decided: " ^ message)
  | exception Refused message -> exit_with 1 ("refused: " ^ message)
  | exception Sys_error message -> exit_with 2 message
  | exception Stack_overflow ->
    exit_with 3 "not decided: the stack is full; allow a larger one with ulimit -s unlimited"
  | exception Out_of_memory -> exit_with 3 "not decided: the memory is full"
  | exception (End_of_file | Failure _ | Invalid_argument _ | Not_found as error) ->
    exit_with 1 ("refused: " ^ Printexc.to_string error)
