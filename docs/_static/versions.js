// A choice of versions above the menu, from versions.json beside the folders of the versions. Without
// that file, as in a build of a single version, there is no choice.
(async () => {
  const root = new URL(document.documentElement.dataset.content_root, location.href);
  const reply = await fetch(new URL("../versions.json", root), { cache: "no-cache" });
  if (!reply.ok) return;
  const versions = await reply.json();
  const here = root.pathname.split("/").at(-2);
  if (!versions.includes(here)) return;
  const choice = document.createElement("select");
  choice.className = "versions";
  choice.setAttribute("aria-label", "Version of these pages");
  for (const version of versions) choice.add(new Option(version, version, false, version === here));
  choice.addEventListener("change", async () => {
    const other = new URL(`../${choice.value}/`, root);
    const page = new URL(location.href.slice(root.href.length), other);
    const there = await fetch(page, { method: "HEAD" });
    location.assign(there.ok ? page : other);
  });
  document.querySelector(".sidebar-brand")?.after(choice);
})().catch(() => {});
