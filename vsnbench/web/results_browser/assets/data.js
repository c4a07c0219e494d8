// Requests to the server, to the files of a website, or to the blocks of JSON in a single file.
//
// A browser refuses requests from a page that was opened as a file, modules included. So all scripts of this page are
// classic ones, which share their names, and a website has each answer as a script that calls `provide`.

const isStatic = document.documentElement.hasAttribute("data-static");
const isSingle = document.documentElement.dataset.static === "single";
const every = Number(document.documentElement.dataset.every ?? 1); // a single file may have every nth picture
const hasFurther = document.documentElement.dataset.cameras !== "main"; // or only those of the main camera
const KEPT_EPISODES = 12;
const session = { csrf_token: "", author: "", title: "" };
const provided = new Map();

function provide(path, content) {
  provided.set(path, content);
}

async function load(path) {
  if (isSingle) return embedded(path);
  if (isStatic) return loadScript(path);
  const answer = await fetch(path, { cache: "no-store" });
  const content = path.endsWith(".svg") && answer.ok ? await answer.text() : await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(content.message || `${path}: ${answer.status}`);
  return content;
}

async function loadScript(path) {
  if (!provided.has(path)) {
    await new Promise((resolve, reject) => {
      const script = make("script", { src: `${path}.js`, onload: resolve, onerror: () => reject(new Error(`${path} is missing`)) });
      document.head.append(script);
    });
  }
  return provided.get(path);
}

// What a block of JSON in this page contains.
function embedded(path) {
  const block = document.getElementById(path);
  if (!block) throw new Error(`${path} is not in this file`);
  return JSON.parse(block.textContent);
}

const pictures = new Map(); // of the latest episodes in a single file

// The address of a picture, and the name of the one that is shown for it: an earlier one where a single file lacks it.
function pictureOf(number, image) {
  if (!isSingle) return { address: `images/${number}/${image}.jpg`, name: image };
  if (!pictures.has(number)) {
    if (pictures.size >= KEPT_EPISODES) pictures.delete(pictures.keys().next().value);
    pictures.set(number, embedded(`images/${number}`));
  }
  const kept = pictures.get(number);
  const name = image in kept ? image : Object.keys(kept).filter((each) => Number(each) <= Number(image)).at(-1) ?? image;
  return { address: kept[name] ?? "", name };
}

// What the cards of some episodes show besides their rows, by number.
async function loadCards(numbers) {
  if (!isStatic) return load(`data/cards/${numbers.join("-")}.json`);
  return Object.assign({}, ...await Promise.all(numbers.map((number) => load(`data/cards/${number}.json`))));
}

async function start() {
  Object.assign(session, await load("data/session.json"));
}

async function post(path, content) {
  const headers = { "Content-Type": "application/json", "X-CSRF-Token": session.csrf_token };
  const answer = await fetch(path, { method: "POST", body: JSON.stringify(content), headers });
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Error(said.message || `refused (${answer.status})`);
  return said;
}

// Rows as objects.
function objects(listed) {
  return listed.rows.map((values) => {
    const row = titled(Object.fromEntries(listed.columns.map((name, i) => [name, values[i]])));
    return { ...row, failure: "", notes: listed.notes[row.id] ?? [], version: listed.versions[row.campaign] ?? "" };
  });
}

// The colour of each model, as in the report's figures: in the order of their first campaigns.
function colorsOf(rows) {
  const first = new Map();
  for (const { condition, campaign } of rows) first.set(condition, Math.min(first.get(condition) ?? Infinity, campaign));
  const ordered = [...first].sort((a, b) => a[1] - b[1]);
  return new Map(ordered.map(([condition], place) => [condition, `var(--model-${place % 8 + 1})`]));
}

function swatch(color) {
  const mark = make("span", { class: "swatch", "aria-hidden": "true" });
  mark.style.background = color;
  return mark;
}

// Adds the model's name with the disturbances of what it saw: another condition of the same model.
function titled(row) {
  return { ...row, condition: row.disturbances ? `${row.model} with ${row.disturbances}` : row.model };
}

// Creates an element. Text is never parsed as HTML, because names in a record are not trusted.
function make(name, fields = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(fields)) {
    if (key === "class") element.className = value;
    else if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key in element && typeof value !== "string") element[key] = value;
    else if (value !== undefined && value !== null && value !== false) element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined && child !== ""));
  return element;
}

const MARKS = { success: "✓", failure: "✗", void: "∅", running: "…", unjudged: "?" };

const resultText = (row) =>
  row.failure && row.outcome === "failure" ? `failure: ${row.failure}` : row.outcome === "success" ? "success" : row.end_reason && row.outcome !== "running"
    ? `${row.outcome}: ${row.end_reason.replaceAll("_", " ")}` : row.outcome;

// Why an episode failed, or its outcome.
const causeOf = (row) => row.outcome === "failure" ? row.failure || (row.end_reason ?? "").replaceAll("_", " ") || "unknown cause"
  : row.outcome === "void" && row.end_reason ? `void: ${row.end_reason.replaceAll("_", " ")}` : row.outcome;

const outcomeChip = (row) => make("span", { class: `outcome ${row.outcome}` }, `${MARKS[row.outcome]} ${causeOf(row)}`);

function grouped(rows, key) {
  const groups = new Map();
  for (const row of rows) {
    const name = key(row);
    if (!groups.has(name)) groups.set(name, []);
    groups.get(name).push(row);
  }
  return groups;
}

const counted = (number, word) => `${number} ${word}${number === 1 ? "" : "s"}`;

// Numbers of successes and of counted episodes.
function successesOf(rows) {
  const all = rows.filter((row) => row.counts);
  return [all.filter((row) => row.outcome === "success").length, all.length];
}

const metres = (value) => (value === null ? "" : `${value.toFixed(2)} m`);
