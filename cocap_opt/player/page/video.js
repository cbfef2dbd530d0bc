// A plan's picture as a video, recorded by the browser while it plays from its first step to its last.

import { make } from "./dom.js";

const VIDEOS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"]; // best first
const RATE = 30, BITS = 8e6; // frames and bits per second
const LAST = 500; // ms, duration of the last frame

export class Recording {
  // Records a canvas; `stop` saves the video under a name.
  constructor(canvas, name) {
    const parts = [], mimeType = Recording.kind();
    this.recorder = new MediaRecorder(canvas.captureStream(RATE), { mimeType, videoBitsPerSecond: BITS });
    this.recorder.addEventListener("dataavailable", ({ data: part }) => parts.push(part));
    this.recorder.addEventListener("stop", () => saveAs(new Blob(parts, { type: "video/webm" }), name));
    this.recorder.start();
  }

  stop() {
    setTimeout(() => this.recorder.stop(), LAST);
  }

  // The best kind of video that the browser can write, if any.
  static kind() {
    return typeof MediaRecorder === "undefined" ? undefined : VIDEOS.find((kind) => MediaRecorder.isTypeSupported(kind));
  }
}

function saveAs(blob, name) {
  const link = make("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
