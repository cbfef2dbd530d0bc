// The proof of a bound: its file, which the page offers, and the commands that check it.

import { make } from "./dom.js";
import { reward } from "./numbers.js";

// A plan's box, which its badge opens.
export function proofBox(data, plan) {
  const proof = data.certificate, which = data.plans.indexOf(plan);
  const box = make("dialog", "proof"), head = make("form");
  head.method = "dialog";
  const close = make("button", "", "✕");
  close.setAttribute("aria-label", "close");
  head.append(make("h2", "", "The certificate"), close);
  box.setAttribute("aria-label", "certificate");
  const about = `No plan has a higher J than ${reward(plan.gap.bound)}. The numbers in this file prove it, and were verified when this page was made.`;
  box.append(head, make("p", "", about), proofFile(proof), make("p", "sum256", `SHA-256 ${proof.sha256}`));
  box.append(make("p", "", "To check it again:"), make("pre", "", proof.verify[which]));
  const lines = proof.check[which];
  if (lines.length) {
    box.append(make("p", "", "Or with cocap-check, a single file of plain Python that shares no code with it:"));
    box.append(make("pre", "", lines.join("\n")), checkPage(proof));
  }
  box.addEventListener("keydown", (event) => event.stopPropagation()); // the player's keys do nothing here
  return box;
}

function proofFile(proof) {
  const line = make("p"), size = proof.bytes < 1e6 ? `${Math.ceil(proof.bytes / 1e3)} kB` : `${(proof.bytes / 1e6).toFixed(1)} MB`;
  if (proof.text === null) {
    line.append(make("b", "", proof.name), `, ${size}, is too large to be part of this page`);
    return line;
  }
  const link = make("a", "", proof.name);
  link.download = proof.name;
  link.href = URL.createObjectURL(new Blob([proof.text], { type: "application/json" }));
  line.append("Download ", link, `, ${size}`);
  return line;
}

function checkPage(proof) {
  const title = "Check a certificate in the browser", line = make("p", "", "The instance and these files can be dropped on the page ");
  if (proof.page) {
    const link = make("a", "", title);
    Object.assign(link, { href: proof.page, target: "_blank", rel: "noopener" });
    line.append(link, " instead of the last command.");
  } else line.append(`“${title}” of cocap-opt's documentation instead of the last command.`);
  return line;
}
