// Runs cocap_check.py with Pyodide in a worker, so that the page stays responsive and can end it.

const folder = new URL("../check/", self.location.href).href;
const TYPES = { wasm: "application/wasm", zip: "application/zip", json: "application/json" };
const NETWORK = ["fetch", "XMLHttpRequest", "WebSocket", "WebTransport", "EventSource", "importScripts"];
const FRESH = { cache: "no-cache" }; // a new build may have other files
const FILES = "/files";
const RUN = `
import contextlib, io, runpy, sys

class Lines(io.TextIOBase):
    def __init__(self, tell):
        self.tell, self.rest = tell, ""

    def write(self, text):
        *lines, self.rest = (self.rest + text).split("\\n")
        for line in lines:
            self.tell(line)
        return len(text)

def run(names, tell):
    sys.argv = ["cocap_check.py", *names]
    try:
        with contextlib.redirect_stdout(Lines(tell)):
            runpy.run_path("/cocap_check.py", run_name="__main__")
    except SystemExit as end:
        return end.code
run
`;

const ABOUT = `
import hashlib, platform

with open("/cocap_check.py", "rb") as file:
    digest = hashlib.sha256(file.read()).hexdigest()
{"python": platform.python_version(), "sha256": digest}
`;

const tell = (type, rest = {}) => self.postMessage({ type, ...rest });

let plain = self.fetch.bind(self);

async function fetched(what, options) {
  const response = await plain(what, options);
  if (!response.ok) throw new Error(`${new URL(response.url).pathname}: ${response.status}`);
  return response;
}

// Compares the bytes that Pyodide fetches with a known total, as servers that compress do not send
// it. Sets content types for servers that do not know them.
function counted(total) {
  let loaded = 0;
  return async (what, options) => {
    const response = await fetched(what, options);
    const counter = new TransformStream({
      transform(chunk, out) {
        loaded += chunk.byteLength;
        tell("loading", { loaded, total });
        out.enqueue(chunk);
      },
    });
    const type = TYPES[new URL(response.url).pathname.split(".").pop()];
    return new Response(response.body.pipeThrough(counter), { headers: { "Content-Type": type } });
  };
}

async function load() {
  const about = await (await fetched(`${folder}files.json`, FRESH)).json();
  const checker = new Uint8Array(await (await fetched(`${folder}cocap_check.py`, FRESH)).arrayBuffer());
  self.fetch = counted(about.bytes);
  const [{ loadPyodide }, compiled] = await Promise.all([
    import(`${folder}pyodide/pyodide.js`),
    import(`${folder}pyodide/pyodide.asm.js`),
  ]);
  const pyodide = await loadPyodide({
    indexURL: `${folder}pyodide/`,
    createPyodideModule: compiled.default,
  });
  pyodide.FS.writeFile("/cocap_check.py", checker);
  const facts = { pyodide: about.pyodide, ...pyodide.runPython(ABOUT).toJs({ dict_converter: Object.fromEntries }) };
  const run = pyodide.runPython(RUN);
  // The visitor's files come next; from here on, no request can leave the worker.
  for (const name of NETWORK) self[name] = undefined;
  plain = undefined;
  return { pyodide, run, facts };
}

const loaded = load();
loaded.then(
  ({ facts }) => tell("ready", facts),
  (error) => tell("failed", { message: `Python could not be loaded: ${error.message}` }),
);

self.onmessage = async ({ data }) => {
  const { pyodide, run } = await loaded, { FS } = pyodide;
  try {
    FS.mkdirTree(FILES);
    FS.chdir(FILES);
    for (const name of FS.readdir(FILES)) if (!/^\.\.?$/.test(name)) FS.unlink(name);
    for (const { name, bytes } of data) FS.writeFile(name, bytes);
    const begun = performance.now();
    const names = pyodide.toPy(data.map(({ argument }) => argument));
    const code = run(names, (text) => tell("line", { text }));
    tell("done", { code, seconds: (performance.now() - begun) / 1000 });
  } catch (error) {
    const words = String(error.message).trim().split("\n").pop();
    const deep = /call stack|recursion/i.test(words) ? ", as a file is nested too deeply for a browser" : "";
    tell("failed", { message: `the check broke off${deep}: ${words}` });
  }
};
