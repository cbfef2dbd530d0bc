(* Advice for the searches of joint states: where tangents touch, shares of conditions, levels of classes.

   Nothing of this file is believed: the checker computes what its numbers prove, whatever they are.
   They are found by conditional gradients, in floating-point numbers: a mixture of the states that
   drones may take is moved towards the states that are best at its own prices, round after round.
   formulations/certificates/staged/relaxation.py does the same, and says why. *)
module Big = Z
open Checker
module Z = Big

let rounds = 60
let least_dropped = 0.1 (* of a node's states: then prices are proved, and others looked for *)
let step_offset = 20.   (* a round goes 2 / (20 + round) of the way *)
let bend = 8.           (* how sharply shares of single gains fall from 1 to 0 *)
let heat_of_lowest = 0.02
let least_mass = 0.3    (* of the mixture of the node above that must be left to begin with it *)
let least_amount = 1. /. 16.  (* of the most that a state sees of a group: tangents touch no lower *)
let fewest_drones = 3
let whole = 1073741824.

(* What a node's conditions, groups and states are, as floating-point numbers. *)
type state = {
  key : int;              (* state and class *)
  spot : int;             (* place and class *)
  of_class : int;         (* its number among the classes left *)
  groups : int array;     (* what it sees, *)
  gains : float array;    (* what that gains alone, *)
  amounts : float array;  (* coarse *)
  pays : float array;     (* of each condition *)
}

type node = {
  constants : float array;
  counts : int array;        (* drones left of each class *)
  states : state array;
  first : int array;         (* of each class, its first state; and the number of states *)
  factors : float array; seen : float array; roots : float array;  (* of groups; seen and its return, coarse *)
  caps : float array;        (* infinite where the return is a root *)
  most : float array;
  unit_ : float;
}

type mixture = { share : float array; amount : float array; gain : float array; value : float array }

(* The shares of states, as the nodes below shall find them; what was seen at the node, and rounds so far. *)
type memory = { shares_of : (int, float) Hashtbl.t; node_seen : so_far_of; round : int; heat : float }

let nothing = { shares_of = Hashtbl.create 1; node_seen = []; round = 0; heat = 0. }

let returned node j z =
  if node.caps.(j) = infinity then sqrt (z *. node.unit_) else Float.min z node.caps.(j)

let node_of coarse specs seen constants pool =
  let unit_ = Z.to_float coarse in
  let specs = Array.of_list specs in
  let factors = Array.map (fun s -> Z.to_float s.s_factor) specs in
  let caps = Array.map (fun s -> match s.s_return with Root -> infinity | AtMost k -> Z.to_float k *. unit_) specs in
  let seen = Array.of_list seen in
  let roots = Array.map (fun (_, r) -> Z.to_float r) seen and seen = Array.map (fun (z, _) -> Z.to_float z) seen in
  let n_groups = Array.length specs in
  let most = Array.make n_groups 0. in
  let node = { constants = Array.of_list (List.map Z.to_float constants); counts = Array.of_list (List.map fst pool);
               states = [||]; first = [||]; factors; seen; roots; caps; most; unit_ } in
  let state c ((cand : named cand), _) =
    let rec views j = function
      | [] -> []
      | a :: rest -> if Z.sign a = 0 then views (j + 1) rest else (j, Z.to_float a) :: views (j + 1) rest in
    let views = Array.of_list (views 0 cand.amounts_up) in
    Array.iter (fun (j, a) -> if a > most.(j) then most.(j) <- a) views;
    let (k, p), (_, s) = cand.name in
    let of_class x = (Z.to_int x lsl 12) + k in
    { key = of_class s; spot = of_class p; of_class = c; groups = Array.map fst views; amounts = Array.map snd views;
      gains = Array.map (fun (j, a) -> factors.(j) *. (returned node j (seen.(j) +. a) -. roots.(j))) views;
      pays = Array.of_list (Z.to_float cand.price0 :: Z.to_float cand.charge
                            :: List.map (fun x -> -. Z.to_float x) cand.static) } in
  let states = Array.of_list (List.concat (List.mapi (fun c (_, l) -> List.map (state c) l) pool)) in
  let first = Array.make (List.length pool + 1) 0 in
  List.iteri (fun c (_, l) -> first.(c + 1) <- first.(c) + List.length l) pool;
  { node with states; first }

let empty node =
  let zeros = Array.make (Array.length node.factors) 0. in
  { share = Array.make (Array.length node.states) 0.; amount = zeros; gain = Array.copy zeros;
    value = Array.copy node.constants }

let add node m x share =
  let s = node.states.(x) in
  m.share.(x) <- m.share.(x) +. share;
  Array.iteri (fun i j ->
      m.amount.(j) <- m.amount.(j) +. share *. s.amounts.(i);
      m.gain.(j) <- m.gain.(j) +. share *. s.gains.(i)) s.groups;
  Array.iteri (fun i pay -> m.value.(i) <- m.value.(i) -. share *. pay) s.pays

let move node m picks step =
  let rest = 1. -. step in
  let shrink a = Array.iteri (fun i x -> a.(i) <- rest *. x) a in
  shrink m.share; shrink m.amount; shrink m.gain;
  Array.iteri (fun i x -> m.value.(i) <- rest *. x +. step *. node.constants.(i)) m.value;
  List.iter (fun x -> add node m x step) picks

let rec is_in (x : int) = function [] -> false | y :: rest -> x = y || is_in x rest

(* Of each class as many states as there are drones, the best, and no place twice where none may be
   shared; what they add up to, and the least of each class.  None if there are too few. *)
let picked node alone worth =
  let total = ref 0. and picks = ref [] and short = ref false in
  let last = Array.mapi (fun c count ->
      let taken = ref [] and least = ref 0. and left = ref count in
      while !left > 0 && not !short do
        let best = ref (-1) in
        for x = node.first.(c) to node.first.(c + 1) - 1 do
          if (!best < 0 || worth.(x) > worth.(!best)) && not (is_in node.states.(x).spot !taken) then best := x
        done;
        if !best < 0 then short := true
        else begin
          let times = if alone then 1 else !left in
          taken := node.states.(!best).spot :: !taken;
          for _ = 1 to times do picks := !best :: !picks done;
          total := !total +. float_of_int times *. worth.(!best);
          least := worth.(!best);
          left := !left - times
        end
      done;
      !least) node.counts in
  if !short then None else Some (!total, last, !picks)

(* Shares of single gains and touching roots of groups; what the mixture gains, and the constant. *)
let slopes node m =
  let n = Array.length node.factors in
  let share = Array.make n 1. and slope = Array.make n 0. and touched = Array.make n 0. in
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
        share.(j) <- a;
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
  (share, slope, touched, !gained, !constant)

let begun node alone memory =
  let mass = Array.make (Array.length node.counts) 0. in
  let above = Array.map (fun s ->
      let x = match Hashtbl.find_opt memory s.key with Some x -> x | None -> 0. in
      mass.(s.of_class) <- mass.(s.of_class) +. x; x) node.states in
  let enough = ref true in
  Array.iteri (fun c count -> if mass.(c) <= least_mass *. float_of_int count then enough := false) node.counts;
  let m = empty node in
  if !enough then begin
    Array.iteri (fun x share -> if share > 0. then
        let c = node.states.(x).of_class in
        add node m x (share *. float_of_int node.counts.(c) /. mass.(c))) above;
    Some m
  end
  else
    let alone_worth = Array.map (fun s -> Array.fold_left (+.) (-. s.pays.(0)) s.gains) node.states in
    match picked node alone alone_worth with
    | None -> None
    | Some (_, _, picks) -> List.iter (fun x -> add node m x 1.) picks; Some m

let to_big x = if Float.is_nan x || Float.abs x > 1e300 then Z.zero else Z.of_float (Float.round x)

(* States that prices drop, as far as floating-point numbers say. *)
let dropped node worth bound last =
  let n = ref 0 in
  Array.iteri (fun x s -> if bound +. worth.(x) -. last.(s.of_class) <= 0. then incr n) node.states;
  !n

(* Numbers that end a node, or else drop many states; None if there is no use in any. *)
let found node alone memory first_round =
  match begun node alone memory.shares_of with
  | None -> (None, { memory with round = rounds })
  | Some m ->
    let heat = ref memory.heat and round = ref first_round and told = ref None in
    let few = Float.to_int (least_dropped *. float_of_int (Array.length node.states)) and best = ref 0 in
    (try
       while !round < rounds do
         let share, slope, touched, gained, constant = slopes node m in
         let values = Array.mapi (fun i v -> if i < 2 then v +. gained else v) m.value in
         let lowest = Array.fold_left Float.min infinity values in
         if lowest > 0. then raise Exit;
         if !heat = 0. then heat := Float.max (-. heat_of_lowest *. lowest) 1e-6;
         let parts = Array.map (fun v -> exp (Float.max ((lowest -. v) /. !heat) (-40.))) values in
         let sum = Array.fold_left (+.) 0. parts in
         let parts = Array.map (fun p -> p /. sum) parts in
         let gaining = parts.(0) +. parts.(1) in
         let base = ref (gaining *. constant) in
         Array.iteri (fun i p -> base := !base +. p *. node.constants.(i)) parts;
         let worth = Array.map (fun s ->
             let v = ref 0. in
             for i = 0 to Array.length s.groups - 1 do
               let j = s.groups.(i) in
               v := !v +. share.(j) *. s.gains.(i) +. slope.(j) *. s.amounts.(i)
             done;
             v := gaining *. !v;
             for i = 0 to Array.length parts - 1 do v := !v -. parts.(i) *. s.pays.(i) done;
             !v) node.states in
         match picked node alone worth with
         | None -> raise Exit
         | Some (total, last, picks) ->
           let bound = !base +. total in
           let n = if bound < 0. then max_int else dropped node worth bound last in
           if n > !best then begin best := n; told := Some (parts, share, touched, last) end;
           incr round;
           if bound < 0. then raise Exit;
           move node m picks (2. /. (step_offset +. float_of_int !round));
           if n > few then raise Exit
       done
     with Exit -> ());
    let shares = Hashtbl.create 64 in
    Array.iteri (fun x share -> if share > 0. then Hashtbl.replace shares node.states.(x).key share) m.share;
    let advice = Option.map (fun (parts, share, touched, last) ->
        let list f a = Array.to_list (Array.map f a) in
        { shares = list (fun p -> to_big (whole *. p)) parts;
          touches = List.combine (list (fun a -> to_big (whole *. a)) share) (list to_big touched);
          levels = list (fun v -> to_big (whole *. v)) last }) !told in
    (advice, { shares_of = shares; node_seen = memory.node_seen; round = !round; heat = !heat })

(* [alone]: no two drones may be at one place. *)
let advise ~coarse ~alone specs seen constants pool memory =
  let again = memory.node_seen == seen in
  let memory = if again then memory else { memory with node_seen = seen; round = 0; heat = 0. } in
  if memory.round >= rounds || List.fold_left (fun n (k, _) -> n + k) 0 pool < fewest_drones
     || List.exists (fun (_, l) -> l = []) pool then (None, memory)
  else found (node_of coarse specs seen constants pool) alone memory memory.round
