// The page's side of tympan/explore/page.py: shows the parts of its state, and says what was done.
"use strict";
const part = (id) => document.getElementById(id);
const state = {};
let socket, typing = null, named = false;
const say = (...words) => socket.send(JSON.stringify(words));
const showFilm = filmViewer(document.querySelector(".viewer"));

// What a part of the state changes besides the elements whose text it is.
const SHOWS = {
  title: (text) => { document.title = `tympan: ${text}`; },
  film: showFilm,
  trouble: (is) => part("status").classList.toggle("trouble", is),
  busy: (is) => part("dot").classList.toggle("busy", is),
  following: (is) => {
    part("following").hidden = !is;
    part("deflections").setAttribute("aria-busy", is);
    for (const id of ["curve", "limits"]) part(id).classList.toggle("stale", is);
  },
  quick: (is) => { part("deflections").dataset.quick = is; },
  curve: (picture) => { part("curve").innerHTML = picture; },
  guessed: (is) => part("numbers").setAttribute("aria-busy", is),
  numbers: (rows) => list("numbers", "result", rows),
  limits: (rows) => list("limits", "limit", rows),
  shapes: (parts) => part("shapes").replaceChildren(...parts.map(newShape)),
  controls: showControls,
  texts: () => { for (const control of state.controls) showText(control); showMasses(); },
  sliders: (places) => {
    for (const key in places) {
      const slider = part(`slider-${key}`);
      // One that is being dragged is where the pointer is.
      if (!slider.matches(":active")) slider.value = places[key];
    }
  },
  errors: (words) => {
    for (const {key} of state.shapes) {
      part(`error-${key}`).textContent = words[key] ?? "";
      part(`error-${key}`).hidden = !words[key];
    }
    for (const control of state.controls) {
      const error = part(`error-${control.key}`);
      error.textContent = words[control.key] ?? "";
      error.hidden = !error.textContent;
      part(`number-${control.key}`).setAttribute("aria-invalid", !error.hidden);
    }
  },
  chosen: () => showChoice("specimen", state.names.length > 1,
                           state.names.map((name, index) => new Option(name, index)), state.chosen),
  masses: showMasses,
  target: (name) => { if (!named) part("name").value = name; },  // what is typed stays
  folder: (path) => { part("folder").value = path; },
};

function show(parts) {
  Object.assign(state, parts);
  for (const key in parts)
    for (const element of document.querySelectorAll(`[data-text=${key}]`))
      element.textContent = parts[key];
  // In this order: what is within a control comes after it.
  for (const key in SHOWS) if (key in parts) SHOWS[key](parts[key]);
}

function list(id, prefix, rows) {
  part(id).replaceChildren(...rows.map((row) => {
    const item = document.createElement("div");
    const name = document.createElement("dt"), text = document.createElement("dd");
    name.textContent = row.name; text.textContent = row.text; text.id = `${prefix}-${row.key}`;
    text.classList.toggle("stale", row.stale);
    if (row.colour) {
      const swatch = document.createElement("span");
      swatch.className = "swatch"; swatch.style.background = row.colour;
      name.prepend(swatch);
    }
    item.append(name, text);
    return item;
  }));
}

function showChoice(id, offered, options, chosen) {
  part(id).closest("label").hidden = !offered;
  part(id).replaceChildren(...options);
  part(id).value = chosen;
}

function showMasses() {
  const here = `${state.texts.mass} g`, none = new Option("none of them", "");
  none.disabled = true;
  const options = state.masses.map((mass) => new Option(mass));
  showChoice("measured", options.length > 0, [none, ...options],
             state.masses.includes(here) ? here : "");
}

function showControls(controls) {
  const keys = controls.map((control) => `control-${control.key}`);
  if ([...part("controls").children].map((item) => item.id).join() !== keys.join())
    part("controls").replaceChildren(...controls.map(newControl));
  for (const control of controls) {
    const slider = part(`slider-${control.key}`), at = slider.value;
    Object.assign(slider, {min: control.low, max: control.high, step: control.step});
    slider.value = at;
  }
}

function newControl({key, label, unit}) {
  const item = part("control").content.firstElementChild.cloneNode(true);
  const [name, slider, number, after, error] = item.children;
  item.id = `control-${key}`; slider.id = `slider-${key}`; number.id = `number-${key}`;
  error.id = `error-${key}`;
  name.htmlFor = slider.id; name.textContent = label; after.textContent = unit;
  number.setAttribute("aria-label", unit ? `${label} in ${unit}` : label);
  slider.addEventListener("input", () => {
    state.texts[key] = slider.value;
    showText({key, unit});
    say("slid", key, slider.value);
  });
  number.addEventListener("input", () => { typing = key; });
  number.addEventListener("change", () => {
    typing = null; state.texts[key] = number.value;
    say("typed", key, number.value);
  });
  number.addEventListener("blur", () => { typing = null; showText({key, unit}); });
  return item;
}

function newShape({key, label, shapes, chosen}) {
  const item = document.createElement("label"), choice = document.createElement("select");
  const error = document.createElement("p");
  choice.id = `shape-${key}`; error.id = `error-${key}`; error.className = "error"; error.role = "alert";
  error.hidden = true;
  choice.replaceChildren(...shapes.map((name) => new Option(name.replaceAll("_", " "), name)));
  choice.value = chosen;
  choice.addEventListener("change", () => say("shape", key, choice.value));
  item.append(`${label} `, choice, error);
  return item;
}

function showText({key, unit}) {  // what is being typed stays
  part(`slider-${key}`).setAttribute("aria-valuetext", `${state.texts[key]} ${unit}`);
  if (typing !== key) part(`number-${key}`).value = state.texts[key];
}

part("specimen").addEventListener("change", (event) => say("choose", Number(event.target.value)));
part("measured").addEventListener("change", (event) => say("typed", "mass", event.target.value));
part("reset").addEventListener("click", () => say("reset"));
part("name").addEventListener("input", () => { named = true; });
part("save").addEventListener("click", () => {
  named = false;
  say("save", part("name").value, part("folder").value);
});
part("copy-command").addEventListener("click", () => navigator.clipboard.writeText(state.command));
part("copy-python").addEventListener("click", () => navigator.clipboard.writeText(state.python));

function connect() {
  const address = new URL("ws", location.href);
  address.protocol = address.protocol.replace("http", "ws");
  socket = new WebSocket(address);
  socket.addEventListener("message", (event) => show(JSON.parse(event.data)));
  socket.addEventListener("close", () => {
    show({message: "The connection to tympan is lost.", trouble: true});
    setTimeout(connect, 1000);
  });
}
connect();
