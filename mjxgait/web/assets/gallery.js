// The page of several champions: one clock for all schools, and the buttons and keys.
//
// `School` of school.js is defined before it, in the same module.

const { scenes } = JSON.parse(document.getElementById("facts").textContent);
const schools = scenes.map((scene, i) => new School(scene, document.getElementById("stages"), i));
const pause = document.getElementById("pause");
let seconds = 0,
  speed = 1,
  paused = false,
  before = 0;

function turn(now) {
  if (!paused) seconds += (speed * Math.min(now - before, 200)) / 1000;
  before = now;
  for (const school of schools) school.draw(seconds);
  requestAnimationFrame(turn);
}
requestAnimationFrame(turn);

pause.addEventListener("click", () => {
  paused = !paused;
  pause.textContent = paused ? "Play" : "Pause";
});
const lookAtAll = () => schools.forEach(school => school.lookAtAll());
document.getElementById("all").addEventListener("click", lookAtAll);
addEventListener("resize", lookAtAll);
addEventListener(
  "keydown",
  event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") lookAtAll();
    if (event.key !== " " || event.target instanceof HTMLButtonElement) return;
    if (!event.repeat) pause.click();
    event.preventDefault();
  },
  { capture: true },
);
const speeds = [...document.querySelectorAll(".speed")];
for (const button of speeds)
  button.addEventListener("click", () => {
    speed = Number(button.dataset.speed);
    for (const other of speeds) other.setAttribute("aria-pressed", String(other === button));
  });
const full = document.getElementById("full"),
  gallery = document.getElementById("gallery");
full.hidden = !document.fullscreenEnabled;
full.addEventListener("click", () =>
  document.fullscreenElement ? document.exitFullscreen() : gallery.requestFullscreen(),
);
// For tests: what a browser shows and moves.
globalThis.schools = schools;
