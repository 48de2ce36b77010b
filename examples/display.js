#!/usr/bin/env node
// A display driver for Node.js: presses actuators as the tactile images say.
//
//     node examples/display.js /run/taxeld/images.sock
//
// Node.js knows no socket of the daemon's type, so `taxel watch --json --newest` reads it, as a child process; `taxel` is to be in
// PATH. Put your hardware into drive(), which is called with the levels of all pressing actuators, 1 to LEVELS, whenever
// they change; it may return a promise. The newest image wins: what came while it was busy is passed over. When the newest
// image is older than DEAD_MAN_MS everything is let go: a display must not press on what the hand no longer feels. The
// child waits for a daemon that went away; where the child ends, so does the driver.
//
// SPDX-License-Identifier: Apache-2.0 OR MIT

"use strict";
const { spawn } = require("node:child_process");

const LEVELS = 8;
const ACTUATORS = 16;
const DEAD_MAN_MS = 200; // a few image periods; at 30 Hz an image comes every 33 ms
const LOOK_MS = 20;

/** Your hardware: sets each actuator to its level, and lets go of those not named. */
function drive(levels, why) {
  const pressed = Object.entries(levels).map(([actuator, level]) => `${actuator}=${level}`);
  console.log(`${why}: ${pressed.join(" ") || "clear"}`);
}

/** CLOCK_MONOTONIC, on which `t_ns` is, in milliseconds. */
const nowMs = () => Number(process.hrtime.bigint()) / 1e6;

/** Lets what came while drive() held everything up be read: Node.js reads behind timers and before immediates. */
const others = () => new Promise((done) => setTimeout(setImmediate, 0, done));

let newest = null; // the last whole line that came, until it is looked at
let arrivedMs = 0;
let feltMs = nowMs(); // when the hand felt what the newest image shows
let shown = "{}"; // what the display shows now
let busy = false; // the hardware is
let ending = false;

async function show(levels, why) {
  const wanted = JSON.stringify(levels);
  if (wanted !== shown) {
    shown = wanted;
    await drive(levels, why);
    await others();
  }
}

/** Shows the newest image, and the next ones, until nothing is new; lets go where the newest is old. */
async function follow() {
  if (busy || ending) return;
  busy = true;
  try {
    do {
      let levels = {};
      if (newest !== null) {
        const image = JSON.parse(newest);
        newest = null;
        levels = Object.fromEntries(image.actuators.map(({ id, level }) => [id, level]));
        // Of a daemon that plays a recording no clock tells how old an image is.
        feltMs = image.latency_us === null ? arrivedMs : image.t_ns / 1e6;
      } else if (nowMs() - feltMs < DEAD_MAN_MS) break;
      if (nowMs() - feltMs < DEAD_MAN_MS) await show(levels, "image");
      else await show({}, "no image");
    } while (newest !== null && !ending);
  } finally {
    busy = false;
  }
}

/** Lets go, whatever the hardware was doing, and ends. */
async function end(code, why) {
  if (ending) return;
  ending = true;
  child.kill();
  for (let waits = 0; busy && waits < 100; waits++) await new Promise((done) => setTimeout(done, LOOK_MS));
  try {
    await drive({}, why);
  } finally {
    process.exit(code);
  }
}

if (process.argv.length !== 3) {
  console.error("usage: display.js SOCKET, such as /run/taxeld/images.sock; taxeld logs where it is");
  process.exit(2);
}
const profile = JSON.stringify({ levels: LEVELS, actuators: ACTUATORS });
const child = spawn("taxel", ["watch", "--json", "--newest", "--reconnect", "--socket", process.argv[2], "--profile", profile], {
  stdio: ["ignore", "pipe", "inherit"],
});

// A terminal that is closed sends SIGHUP.
for (const signal of ["SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT"]) process.on(signal, () => end(0, "stopped"));
const fail = (error) => {
  console.error(`display: ${error.message}`);
  end(1, "stopped");
};
process.on("uncaughtException", fail);
process.stdout.on("error", () => end(1, "stopped"));
child.on("error", fail); // there is no `taxel`
child.on("close", (code) => end(code ?? 1, "closed"));

// All that is there is taken at once, and of that the last whole line: readline would hand over each of them.
let rest = "";
child.stdout.setEncoding("utf8");
child.stdout.on("data", (text) => {
  const lines = (rest + text).split("\n");
  rest = lines.pop();
  if (lines.length > 0) {
    newest = lines[lines.length - 1];
    arrivedMs = nowMs();
    follow();
  }
});
setInterval(follow, LOOK_MS);
