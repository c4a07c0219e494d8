// Requests to the server, or to the files of a website.
//
// A browser refuses requests from a page that was opened as a file, modules included. So all scripts of this page are
// classic ones, which share their names, and a website has each answer as a script that calls `provide`.

const isStatic = document.documentElement.hasAttribute("data-static");
const session = { csrf_token: "", author: "", title: "" };
const provided = new Map();

function provide(path, content) {
  provided.set(path, content);
}

async function load(path) {
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
  return listed.rows.map((row) => titled(Object.fromEntries(listed.columns.map((name, i) => [name, row[i]]))));
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

const metres = (value) => (value === null ? "" : `${value.toFixed(2)} m`);
