"use strict";
const isPictures = (row) => row?.classList.contains("below") ?? false;
const picturesOf = (row) => (isPictures(row.nextElementSibling) ? [row.nextElementSibling] : []);
for (const button of document.querySelectorAll("thead button")) {
  button.addEventListener("click", () => {
    const heading = button.parentElement, table = heading.closest("table"), body = table.tBodies[0];
    const place = heading.cellIndex, down = heading.getAttribute("aria-sort") === "ascending";
    for (const other of table.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", down ? "descending" : "ascending");
    const number = heading.classList.contains("number");
    const key = (row) => {
      const text = row.cells[place].dataset.key ?? row.cells[place].textContent;
      return number ? (text === "-inf" ? -Infinity : Number.parseFloat(text)) : text;
    };
    const order = (a, b) => (number ? a - b || 0 : String(a).localeCompare(String(b), "en", { numeric: true }));
    const rows = [...body.rows].filter((row) => !isPictures(row)).map((row) => [key(row), row, picturesOf(row)]);
    rows.sort(([a], [b]) => (down ? -order(a, b) : order(a, b)));
    body.append(...rows.flatMap(([, row, pictures]) => [row, ...pictures]));
  });
}
const filter = document.getElementById("filter");
filter?.addEventListener("input", () => {
  const words = filter.value.toLowerCase().split(/[\s,]+/).filter(Boolean);
  let shown = 0;
  for (const row of document.getElementById("episode-table").tBodies[0].rows) {
    if (isPictures(row)) continue;
    const cells = [...row.cells].filter((cell) => !cell.classList.contains("pictures"));
    const text = cells.map((cell) => cell.textContent.toLowerCase()).join(" ");
    row.hidden = !words.every((word) => text.includes(word));
    for (const pictures of picturesOf(row)) pictures.hidden = row.hidden;
    shown += row.hidden ? 0 : 1;
  }
  document.getElementById("matches").textContent = words.length ? `${shown} match` : "";
});
// An episode's pictures open in a row of their own below it: no column grows as wide as they are.
for (const details of document.querySelectorAll("#episode-table details")) {
  const row = details.closest("tr"), strip = details.querySelector("img");
  const below = document.createElement("tr"), cell = below.insertCell();
  below.className = "below";
  cell.colSpan = row.cells.length;
  details.addEventListener("toggle", () => {
    if (details.open) {
      cell.append(strip);
      row.after(below);
    } else {
      below.remove();
      details.append(strip);
    }
  });
}
const theme = document.getElementById("theme");
let dark = matchMedia("(prefers-color-scheme: dark)").matches;
const paint = () => {
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  theme.textContent = dark ? "Light" : "Dark";
};
theme.addEventListener("click", () => { dark = !dark; paint(); });
paint();
const openTarget = () => {
  const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
  if (target) target.scrollIntoView();
};
addEventListener("hashchange", openTarget);
openTarget();
addEventListener("beforeprint", () => { for (const fold of document.querySelectorAll("details.fold")) fold.open = true; });
const scrollers = document.querySelectorAll(".scroll");
const mark = (box) => {
  box.classList.toggle("more", box.scrollLeft + box.clientWidth < box.scrollWidth - 2);
  box.classList.toggle("moved", box.scrollLeft > 2);
};
const watch = new ResizeObserver((entries) => { for (const entry of entries) mark(entry.target.closest(".scroll")); });
for (const box of scrollers) {
  const hint = document.createElement("p");
  hint.className = "hint";
  hint.setAttribute("aria-hidden", "true");
  hint.textContent = "\u2194 wider than the screen: scroll it sideways";
  box.after(hint);
  box.addEventListener("scroll", () => mark(box), { passive: true });
  watch.observe(box);
  if (box.firstElementChild) watch.observe(box.firstElementChild);
}
