(* Advice for the searches of joint states: where tangents touch, shares of conditions, levels of classes.

   Nothing of this file is believed: the checker computes what its numbers prove, whatever they are.
   They are found by conditional gradients, in floating-point numbers: a mixture of the states that
   drones may take is moved towards the states that are best at its own prices, round after round.
   formulations/certificates/staged/relaxation.py does the same, and says why. *)
module Big = Z
open Checker
module Z = Big

let rounds = 60
let step_offset = 20.   (* a round goes 2 / (20 + round) of the way *)
let bend = 8.           (* how sharply shares of single gains fall from 1 to 0 *)
let heat_of_lowest = 0.02
let least_mass = 0.3    (* of the mixture of the node above that must be left to begin with it *)
let least_amount = 1. /. 16.  (* of the most that a state sees of a group: tangents touch no lower *)
let least_dropped = 0.15      (* of a node's states, for prices that do not end it to be proved *)
let nearly = 0.9              (* of what prices drop together, that the last of them shall drop *)
let fewest_drones = 3
let whole = 1073741824.
let shares_in = 1024.         (* conditions have shares of 1 in so many, so that sums stay one word *)

module Table = Hashtbl.Make (struct type t = int let equal (a : int) b = a = b let hash (a : int) = a land max_int end)

(* A state for a drone, in floating-point numbers. *)
type state = {
  of_cand : named cand;
  key : int;              (* state and class *)
  spot : int;             (* place and class *)
  groups : int array;     (* what it sees, and how much, coarse *)
  amounts : float array;
  pays : float array;     (* of each condition *)
}

(* What is told of a node, and what its drones, groups and conditions are. *)
type node = {
  constants : float array;
  counts : int array;        (* drones left of each class *)
  states : state array;
  gains : float array array; (* of each state, what it gains alone of its groups *)
  first : int array;         (* of each class, its first state; and the number of states *)
  factors : float array; seen : float array; roots : float array;  (* of groups; seen and its return, coarse *)
  caps : float array;        (* infinite where the return is a root *)
  most : float array;
  unit_ : float;
  alive : bool array;        (* states that no prices have dropped so far *)
}

type mixture = { share : float array; amount : float array; gain : float array; value : float array }

(* [table]: the states of a search.  [shares_of]: of states in the mixture of the node above.
   [pending]: what else is to be told of the node that was asked for last; None after its last answer,
   so that the next question is of another node. *)
type memory = {
  table : state Table.t option;
  shares_of : float Table.t;
  pending : advice list option }

let nothing = { table = None; shares_of = Table.create 1; pending = None }

let state_of (cand : named cand) =
  let rec views j = function
    | [] -> []
    | a :: rest -> if Z.sign a = 0 then views (j + 1) rest else (j, Z.to_float a) :: views (j + 1) rest in
  let views = Array.of_list (views 0 cand.amounts_up) in
  let (k, p), (_, s) = cand.name in
  let of_class x = (Z.to_int x lsl 12) + k in
  { of_cand = cand; key = of_class s; spot = of_class p; groups = Array.map fst views; amounts = Array.map snd views;
    pays = Array.of_list (Z.to_float cand.price0 :: Z.to_float cand.charge :: List.map (fun x -> -. Z.to_float x) cand.static) }

let known table (cand : named cand) =
  let (k, _), (_, s) = cand.name in
  let key = (Z.to_int s lsl 12) + k in
  match Table.find_opt table key with
  | Some found when found.of_cand == cand -> found
  | _ -> let made = state_of cand in Table.replace table key made; made

let node_of coarse specs seen constants pool table =
  let unit_ = Z.to_float coarse in
  let specs = Array.of_list specs in
  let factors = Array.map (fun s -> Z.to_float s.s_factor) specs in
  let caps = Array.map (fun s -> match s.s_return with Root -> infinity | AtMost k -> Z.to_float k *. unit_) specs in
  let seen = Array.of_list seen in
  let roots = Array.map (fun (_, r) -> Z.to_float r) seen and seen = Array.map (fun (z, _) -> Z.to_float z) seen in
  let most = Array.make (Array.length specs) 0. in
  let states = Array.of_list (List.concat_map (fun (_, l) -> List.map (fun (cand, _) -> known table cand) l) pool) in
  let gains = Array.map (fun s ->
      let n = Array.length s.groups in
      let gains = Array.make n 0. in
      for i = 0 to n - 1 do
        let j = s.groups.(i) and a = s.amounts.(i) in
        if a > most.(j) then most.(j) <- a;
        let z = seen.(j) +. a in
        let worth = if caps.(j) = infinity then sqrt (z *. unit_) else Float.min z caps.(j) in
        gains.(i) <- factors.(j) *. (worth -. roots.(j))
      done;
      gains) states in
  let first = Array.make (List.length pool + 1) 0 in
  List.iteri (fun c (_, l) -> first.(c + 1) <- first.(c) + List.length l) pool;
  { constants = Array.of_list (List.map Z.to_float constants); counts = Array.of_list (List.map fst pool);
    states; gains; first; factors; seen; roots; caps; most; unit_; alive = Array.make (Array.length states) true }

let empty node =
  let n = Array.length node.factors in
  { share = Array.make (Array.length node.states) 0.; amount = Array.make n 0.; gain = Array.make n 0.;
    value = Array.copy node.constants }

let add node m x share =
  let s = node.states.(x) and gains = node.gains.(x) in
  m.share.(x) <- m.share.(x) +. share;
  for i = 0 to Array.length s.groups - 1 do
    let j = s.groups.(i) in
    m.amount.(j) <- m.amount.(j) +. share *. s.amounts.(i);
    m.gain.(j) <- m.gain.(j) +. share *. gains.(i)
  done;
  for i = 0 to Array.length m.value - 1 do m.value.(i) <- m.value.(i) -. share *. s.pays.(i) done

let move node m picks step =
  let rest = 1. -. step in
  let shrink a = for i = 0 to Array.length a - 1 do a.(i) <- rest *. a.(i) done in
  shrink m.share; shrink m.amount; shrink m.gain;
  for i = 0 to Array.length m.value - 1 do m.value.(i) <- rest *. m.value.(i) +. step *. node.constants.(i) done;
  List.iter (fun x -> add node m x step) picks

let rec is_in (x : int) = function [] -> false | y :: rest -> x = y || is_in x rest

(* Of each class as many states as there are drones, the best, and no place twice where none may be
   shared; what they add up to, and the least of each class.  None if there are too few. *)
let picked node alone alive (worth : float array) =
  let total = ref 0. and picks = ref [] and short = ref false in
  let last = Array.mapi (fun c count ->
      let taken = ref [] and least = ref 0. and left = ref count in
      while !left > 0 && not !short do
        let best = ref (-1) and most = ref neg_infinity in
        for x = node.first.(c) to node.first.(c + 1) - 1 do
          if worth.(x) > !most && alive.(x) && not (is_in node.states.(x).spot !taken) then begin
            best := x; most := worth.(x) end
        done;
        if !best < 0 then short := true
        else begin
          let times = if alone then 1 else !left in
          taken := node.states.(!best).spot :: !taken;
          for _ = 1 to times do picks := !best :: !picks done;
          total := !total +. float_of_int times *. !most;
          least := !most;
          left := !left - times
        end
      done;
      !least) node.counts in
  if !short then None else Some (!total, last, !picks)

(* Prices: shares of single gains and touching roots of groups, of which slopes and a constant follow. *)
type prices = {
  parts : float array;  (* of conditions *)
  single : float array; slope : float array; touched : float array;
  gained : float;       (* what the mixture gains at most *)
  constant : float }

let prices_at node m =
  let n = Array.length node.factors in
  let single = Array.make n 1. and slope = Array.make n 0. and touched = Array.make n 0. in
  let gained = ref 0. and constant = ref 0. in
  for j = 0 to n - 1 do
    let gain = m.gain.(j) and f = node.factors.(j) in
    if gain > 0. then begin
      let is_root = node.caps.(j) = infinity in
      let together =
        f *. ((if is_root then sqrt ((node.seen.(j) +. m.amount.(j)) *. node.unit_) else node.caps.(j)) -. node.roots.(j)) in
      if together > 0. then begin
        gained := !gained +. Float.min gain together;
        let a = Float.min 1. (Float.max 0. (0.5 -. bend *. (gain -. together) /. together)) in
        single.(j) <- a;
        if is_root then begin
          let root = sqrt ((node.seen.(j) +. Float.max m.amount.(j) (least_amount *. node.most.(j))) *. node.unit_) in
          touched.(j) <- root;
          slope.(j) <- f *. (1. -. a) *. node.unit_ /. (2. *. root);
          constant := !constant +. f *. (1. -. a)
            *. (node.seen.(j) *. node.unit_ +. root *. root -. 2. *. root *. node.roots.(j)) /. (2. *. root)
        end
        else constant := !constant +. (1. -. a) *. together
      end
    end
  done;
  { parts = [||]; single; slope; touched; gained = !gained; constant = !constant }

let worths node p =
  let gaining = p.parts.(0) +. p.parts.(1) in
  let worth = Array.make (Array.length node.states) 0. in
  for x = 0 to Array.length worth - 1 do
    let s = node.states.(x) and gains = node.gains.(x) in
    let v = ref 0. in
    for i = 0 to Array.length s.groups - 1 do
      let j = s.groups.(i) in
      v := !v +. p.single.(j) *. gains.(i) +. p.slope.(j) *. s.amounts.(i)
    done;
    v := gaining *. !v;
    for i = 0 to Array.length p.parts - 1 do v := !v -. p.parts.(i) *. s.pays.(i) done;
    worth.(x) <- !v
  done;
  worth

(* The mixture of the node above, if enough of it is left; else the states that gain most alone. *)
let begun node alone shares_of =
  let classes = Array.length node.counts in
  let above = Array.map (fun s -> match Table.find_opt shares_of s.key with Some x -> x | None -> 0.) node.states in
  let mass = Array.init classes (fun c ->
      let sum = ref 0. in
      for x = node.first.(c) to node.first.(c + 1) - 1 do sum := !sum +. above.(x) done;
      !sum) in
  let enough = ref true in
  Array.iteri (fun c count -> if mass.(c) <= least_mass *. float_of_int count then enough := false) node.counts;
  let m = empty node in
  if !enough then begin
    Array.iteri (fun c count ->
        for x = node.first.(c) to node.first.(c + 1) - 1 do
          if above.(x) > 0. then add node m x (above.(x) *. float_of_int count /. mass.(c))
        done) node.counts;
    Some m
  end
  else
    let worth = Array.mapi (fun x s -> Array.fold_left (+.) (-. s.pays.(0)) node.gains.(x)) node.states in
    match picked node alone node.alive worth with
    | None -> None
    | Some (_, _, picks) -> List.iter (fun x -> add node m x 1.) picks; Some m

let to_big x = if Float.is_nan x || Float.abs x > 1e300 then Z.zero else Z.of_float (Float.round x)

let told p last =
  let list f a = Array.to_list (Array.map f a) in
  { shares = list (fun p -> to_big (shares_in *. p)) p.parts;
    touches = List.combine (list (fun a -> to_big (whole *. a)) p.single) (list to_big p.touched);
    levels = list (fun v -> to_big (shares_in *. v)) last }

(* What prices drop, one after the other, as far as floating-point numbers say, and the advice. *)
let dropped_by node alone sequence =
  let alive = Array.map (fun _ -> true) node.alive and n = ref 0 and ended = ref false in
  let advice = List.filter_map (fun (p, worth, base) ->
      if !ended then None
      else match picked node alone alive worth with
        | None -> ended := true; None
        | Some (total, last, _) ->
          let bound = base +. total in
          if bound < 0. then ended := true
          else
            for c = 0 to Array.length node.counts - 1 do
              for x = node.first.(c) to node.first.(c + 1) - 1 do
                if alive.(x) && bound +. worth.(x) -. last.(c) <= 0. then begin alive.(x) <- false; incr n end
              done
            done;
          Some (told p last)) sequence in
  ((if !ended then Array.length alive else !n), advice)

(* The last of some prices, latest first, that drop nearly as much as all of them. *)
let few_of node alone most latest_first =
  let all = List.length latest_first in
  let rec go count =
    let last = List.rev (List.filteri (fun i _ -> i < count) latest_first) in
    let n, advice = dropped_by node alone last in
    if count >= all || n = most || (most < Array.length node.states && float_of_int n >= nearly *. float_of_int most) then advice
    else go (min all (count + (count + 1) / 2)) in
  if all = 0 then [] else go 1

(* All that is to be told of a node, in this order, and its mixture of states. *)
let found node alone shares_of =
  match begun node alone shares_of with
  | None -> ([], shares_of)
  | Some m ->
    let heat = ref 0. and sequence = ref [] and n_dropped = ref 0 and ended = ref false in
    (try
       for round = 0 to rounds - 1 do
         let p = prices_at node m in
         let values = Array.mapi (fun i v -> if i < 2 then v +. p.gained else v) m.value in
         let lowest = Array.fold_left Float.min infinity values in
         if lowest > 0. then raise Exit;
         if !heat = 0. then heat := Float.max (-. heat_of_lowest *. lowest) 1e-6;
         let parts = Array.map (fun v -> exp (Float.max ((lowest -. v) /. !heat) (-40.))) values in
         let sum = Array.fold_left (+.) 0. parts in
         let p = { p with parts = Array.map (fun p -> Float.round (shares_in *. p /. sum) /. shares_in) parts } in
         let base = ref ((p.parts.(0) +. p.parts.(1)) *. p.constant) in
         Array.iteri (fun i part -> base := !base +. part *. node.constants.(i)) p.parts;
         let worth = worths node p in
         match picked node alone node.alive worth with
         | None -> ended := true; raise Exit
         | Some (total, last, picks) ->
           let bound = !base +. total in
           if bound < 0. then begin
             ended := true;
             sequence := (p, worth, !base) :: !sequence;
             raise Exit
           end;
           let n = ref 0 in
           for c = 0 to Array.length node.counts - 1 do
             for x = node.first.(c) to node.first.(c + 1) - 1 do
               if node.alive.(x) && bound +. worth.(x) -. last.(c) <= 0. then begin
                 node.alive.(x) <- false; incr n end
             done
           done;
           if !n > 0 then begin
             n_dropped := !n_dropped + !n;
             sequence := (p, worth, !base) :: !sequence
           end;
           move node m picks (2. /. (step_offset +. float_of_int round))
       done
     with Exit -> ());
    let shares = Table.create 64 in
    Array.iteri (fun x share -> if share > 0. && node.alive.(x) then Table.replace shares node.states.(x).key share) m.share;
    let most_dropped = if !ended then Array.length node.states else !n_dropped in
    let of_use = !ended || float_of_int !n_dropped > least_dropped *. float_of_int (Array.length node.states) in
    ((if of_use then few_of node alone most_dropped !sequence else []), shares)

(* [alone]: no two drones may be at one place. *)
let advise ~coarse ~alone specs seen constants pool memory =
  let answer memory = function
    | [] -> (None, { memory with pending = None })
    | first :: rest -> (Some first, { memory with pending = Some rest }) in
  match memory.pending with
  | Some rest -> answer memory rest
  | None ->
    if List.fold_left (fun n (k, _) -> n + k) 0 pool < fewest_drones || List.exists (fun (_, l) -> l = []) pool then (None, memory)
    else
      let table = match memory.table with Some table -> table | None -> Table.create 1000 in
      let told, shares_of = found (node_of coarse specs seen constants pool table) alone memory.shares_of in
      answer { memory with table = Some table; shares_of } told
