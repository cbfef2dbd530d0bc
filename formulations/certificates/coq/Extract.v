(** The checker as an OCaml program: integers by Zarith, as Coq's own extraction has them. *)
From Coq Require Import ZArith Extraction ExtrOcamlBasic ExtrOcamlZBigInt ExtrOcamlNatInt.
From CocapCheck Require Import Spec Rows Prices Checker Staged Paths Build.

(* A root is looked for, not trusted: what is found is checked by multiplication (root_of). *)
(* So are those of the search, which are small mostly (root_up, root_down of Search.v). *)
Extract Constant Z.sqrt => "(fun n -> if Big_int_Z.is_int_big_int n && Big_int_Z.int_of_big_int n >= 0
  then Big_int_Z.big_int_of_int (int_of_float (sqrt (float_of_int (Big_int_Z.int_of_big_int n))))
  else Big_int_Z.sqrt_big_int (Big_int_Z.abs_big_int n))".
Extract Constant Z.sqrt_up => "(fun n -> let r = Big_int_Z.sqrt_big_int n in Big_int_Z.succ_big_int r)".
(* Most of what is compared is a small number, or zero: then it is one word. *)
Extract Constant Z.eqb => "(fun a b -> a == b || Big_int_Z.eq_big_int a b)".
(* Coq's own directive for positive, with a shift for the division by two, and machine integers where they are enough. *)
Extract Inductive positive => "Big_int_Z.big_int"
  ["(fun p -> Big_int_Z.succ_big_int (Big_int_Z.shift_left_big_int p 1))"
   "(fun p -> Big_int_Z.shift_left_big_int p 1)" "Big_int_Z.unit_big_int"]
  "(fun odd even one p -> if Big_int_Z.is_int_big_int p then
      let n = Big_int_Z.int_of_big_int p in
      if n = 1 then one () else
      let q = Big_int_Z.big_int_of_int (n lsr 1) in
      if n land 1 = 0 then even q else odd q
    else
      let q = Big_int_Z.shift_right_big_int p 1 in
      if Big_int_Z.eq_big_int (Big_int_Z.shift_left_big_int q 1) p then even q else odd q)".
Extraction Blacklist List String Z Q Big_int_Z.
Extraction "checker.ml" build check_tree check_staged whole_bound.

(* What the theorems rest on. *)
Print Assumptions tree_sound.
Print Assumptions staged_sound.
