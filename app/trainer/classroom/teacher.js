"use strict";
// The teacher's page: shows what the websocket tells, and sends what the teacher does.
const $ = id => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
let socket, version = -1, waiting = 500;

function send(command) {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
    else say("No connection: the trainer does not answer.", true);
}

function say(words, refused = false) {
    $("notice").textContent = words;
    $("notice").classList.toggle("refused", refused);
}

function connect() {
    socket = new WebSocket(new URL("live", location.href).href.replace(/^http/, "ws"));
    socket.onopen = () => {
        waiting = 500;
        socket.send('{"type":"hello"}');
    };
    socket.onmessage = event => {
        const message = JSON.parse(event.data);
        if (message.rows) show(message);
        else if (message.notice) {
            say(message.notice);
            if (message.assigned) $("write").open = false;
        }
        else if (message.refused && !message.refused.includes("'hello'")) say(message.refused, true);
    };
    socket.onclose = () => {
        $("connection").textContent = "The trainer does not answer; trying again …";
        $("connection").classList.add("refused");
        setTimeout(connect, waiting);
        waiting = Math.min(2 * waiting, 5000);
    };
}

function show(message) {
    const here = message.rows.filter(row => row.live).length;
    $("connection").textContent = "Live";
    $("connection").classList.remove("refused");
    $("count").textContent = message.rows.length
        ? `${here} of ${message.rows.length}${message.nameless ? `, and ${message.nameless} without a name` : ""}`
        : message.nameless ? `${message.nameless} without a name yet` : "";
    $("nobody").hidden = message.rows.length > 0;
    $("people").hidden = message.rows.length === 0;
    showExercise(message.exercise);
    showPeople(message.rows);
    if (message.version !== version) {
        version = message.version;
        showResults();
        showCourse();
    }
    $("no-course").hidden = Boolean(message.levels);
    $("all-levels").hidden = !message.levels;
    if (message.levels && $("level-for-all").dataset.key !== message.levels) {
        $("level-for-all").dataset.key = message.levels;
        // Made by the server, which has escaped the titles.
        $("level-for-all").innerHTML = message.levels;
    }
    set($("sent"), message.sending);
}

// The section is made by the server, which has escaped all that people typed.
async function showCourse() {
    try {
        const answer = await fetch("course");
        if (!answer.ok) return;
        const page = new DOMParser().parseFromString(await answer.text(), "text/html");
        replaceOpen($("progress"), page.body.childNodes);
        for (const choice of $("progress").querySelectorAll("select.level"))
            choice.onchange = () => send({type: "level", person: choice.dataset.person, level: choice.value});
    } catch {
        version = -1;
    }
}

// What a reader has opened stays open: by its title, without the counts in it.
function replaceOpen(where, parts) {
    const title = each => each.querySelector("summary").textContent.replace(/\d+/g, "");
    const open = new Set([...where.querySelectorAll("details[open]")].map(title));
    where.replaceChildren(...parts);
    for (const each of where.querySelectorAll("details")) each.open = open.has(title(each));
}

// An exercise file from the fields of the form.
function written() {
    const goal = $("goal").value, where = $("form").querySelector(`[data-goal=${goal}]`).dataset.where;
    const lines = [`title = ${JSON.stringify($("title").value || $("goal").selectedOptions[0].text)}`,
        `text = ${JSON.stringify($("words").value)}`, `goal = "${goal}"`, `feedback = "${$("feedback").value}"`];
    const number = input => {
        const value = Number(input.value) / Number(input.dataset.factor);
        return `${input.dataset.key.split(".").pop()} = ${Number(value.toPrecision(12))}`;
    };
    const filled = where => [...where.querySelectorAll("input[data-key]")].filter(input => input.value !== "");
    const seed = $("form").querySelector("[data-key=seed]");
    const preset = where === "anatomy" ? "" : $("preset").value;
    if (where || preset) {
        lines.push("", "[duct]");
        if (preset) lines.push(`preset = ${JSON.stringify(preset)}`);
        if (where === "bed" && $("relaxes").value) lines.push("relaxes = true");
        if (where === "anatomy") lines.push(`anatomy = ${JSON.stringify($("anatomy").value)}`);
        else if (where && $("bed").value) lines.push(`bed = ${JSON.stringify($("bed").value)}`);
        if (where && seed.value) lines.push(number(seed));
    }
    lines.push("", "[limits]", ...filled($("form").querySelector(`[data-goal=${goal}]`)).map(number));
    lines.push("", "[errors]", ...filled($("errors")).map(number));
    return `${lines.join("\n")}\n`;
}

function fitForm() {
    for (const fields of $("form").querySelectorAll("[data-goal]")) fields.hidden = fields.dataset.goal !== $("goal").value;
    const where = $("form").querySelector(`[data-goal=${$("goal").value}]`).dataset.where;
    for (const field of $("form").querySelectorAll(".of-bed, .of-anatomy")) field.hidden = !field.classList.contains(`of-${where}`);
    $("title").placeholder = $("goal").selectedOptions[0].text;
}

function showExercise(exercise) {
    $("start").disabled = !exercise || exercise.going;
    $("start").textContent = exercise?.started && !exercise.going ? "Start again for all" : "Start for all";
    $("stop").disabled = !exercise?.going;
    if (!exercise) {
        $("write").open ||= version < 0;
        return;
    }
    const key = JSON.stringify(exercise);
    if ($("now").dataset.key === key) return;
    $("now").dataset.key = key;
    const title = element("h3", exercise.title);
    title.append(element("span", exercise.going ? "going on" : exercise.started ? "stopped" : "set, not started", "state"));
    $("now").replaceChildren(title, element("p", exercise.text),
        labelled("Goal", exercise.goal), labelled("Limit", exercise.limit));
}

function labelled(label, words) {
    const line = element("p");
    line.append(element("b", label), " ", words);
    return line;
}

function element(tag, words, look) {
    const made = document.createElement(tag);
    if (words !== undefined) made.textContent = words;
    if (look) made.className = look;
    return made;
}

function showPeople(rows) {
    const body = $("people").tBodies[0];
    const there = new Map([...body.rows].map(row => [row.dataset.id, row]));
    for (const person of rows) {
        let row = there.get(person.id);
        there.delete(person.id);
        if (!row) {
            row = body.insertRow();
            row.dataset.id = person.id;
            for (let i = 0; i < 6; i++) row.insertCell();
            const watch = element("a", "Watch", "button");
            watch.href = `../?watch=${encodeURIComponent(person.id)}`;
            const report = element("a", "Report", "button");
            report.href = `report?person=${encodeURIComponent(person.id)}`;
            const remove = element("button", "Delete");
            remove.onclick = () => askDelete(person.id, row.cells[0].dataset.name);
            watch.target = report.target = "_blank";
            row.cells[5].append(watch, report, remove);
            row.cells[1].append(sketch());
            row.cells[2].append(bar());
        }
        fill(row, person);
    }
    for (const gone of there.values()) gone.remove();
}

function fill(row, person) {
    const [name, duct, distance, exercise, best, actions] = row.cells;
    const live = person.live;
    row.classList.toggle("away", !live);
    if (name.dataset.name !== person.name) {
        name.dataset.name = person.name;
        name.textContent = person.name;
    }
    for (const cell of [duct, distance, actions]) cell.firstChild.style.display = live ? "" : "none";
    set(exercise, live
        ? [`${live.work}: ${live.state}`, live.standing, person.problem].filter(Boolean).join(", ") : "not here");
    exercise.classList.toggle("refused", Boolean(person.problem));
    set(best, person.best ? `${person.best} (${person.tries} ${person.tries === 1 ? "try" : "tries"})` : "–");
    if (!live) return;
    const percent = Math.round(100 * live.distance);
    const [fillBar, label] = distance.firstChild.children;
    fillBar.style.width = `${percent}%`;
    fillBar.className = live.torn ? "torn" : percent < 15 ? "stop" : percent < 40 ? "careful" : "safe";
    set(label, live.torn ? "torn" : `${percent} %`);
    draw(duct.firstChild, live);
}

function set(cell, words) {
    if (cell.textContent !== words) cell.textContent = words;
}

function bar() {
    const made = element("div", undefined, "bar");
    made.append(element("i"), element("b"));
    return made;
}

function sketch() {
    const made = document.createElementNS(SVG, "svg");
    made.setAttribute("class", "sketch");
    made.setAttribute("role", "img");
    made.setAttribute("aria-label", "The duct, from the side");
    for (const name of ["bed", "duct", "hands"]) {
        const path = document.createElementNS(SVG, "path");
        path.setAttribute("class", name);
        made.append(path);
    }
    return made;
}

function draw(svg, live) {
    const along = live.duct.map(place => place[0]);
    const low = Math.min(...along), width = Math.max(...along) - low;
    svg.setAttribute("viewBox", `${low - 3} ${-0.36 * width} ${width + 6} ${0.46 * width}`);
    const [bed, duct, hands] = svg.children;
    bed.setAttribute("d", `M${low} 4h${width}`);
    duct.setAttribute("d", `M${live.duct.map(([x, z]) => `${x} ${-z}`).join("L")}`);
    duct.classList.toggle("torn", live.torn);
    hands.setAttribute("d", live.hands.map(([x, z]) => `M${x} ${-z - 1}v-30`).join(""));
}

function askDelete(id, name) {
    $("question").textContent = `Delete ${name} with all results? This cannot be undone.`;
    $("sure").onclose = () => {
        if ($("sure").returnValue === "yes") send({type: "delete", person: id});
        $("sure").returnValue = "";
    };
    $("sure").showModal();
}

async function showResults() {
    try {
        const answer = await fetch("results");
        if (!answer.ok) return;
        // Made by the server, which has escaped all that people typed.
        const page = new DOMParser().parseFromString(await answer.text(), "text/html");
        replaceOpen($("found"), page.body.childNodes);
        for (const choice of $("found").querySelectorAll("select.rating"))
            choice.onchange = () => send({type: "rate", run: choice.dataset.run, points: choice.value === "" ? null : Number(choice.value)});
    } catch {
        version = -1;
    }
}

$("form").oninput = () => {
    fitForm();
    $("text").value = written();
};
$("form").onsubmit = event => event.preventDefault();
$("give-course").onclick = () => send({type: "course", default: true});
$("set-course").onclick = () => send({type: "course", text: $("course-text").value});
$("end-course").onclick = () => send({type: "course"});
$("level-for-all").onchange = () => send({type: "level", level: $("level-for-all").value});
$("store").onsubmit = event => {
    event.preventDefault();
    send({type: "connect", url: $("store-url").value, version: $("store-version").value, key: $("store-key").value, secret: $("store-secret").value});
    $("store-secret").value = "";
};
$("store-off").onclick = () => send({type: "connect", url: ""});
$("file").onchange = async () => {
    const [file] = $("file").files;
    if (!file) return;
    if (file.size > 20000) say("An exercise file has at most 20,000 characters.", true);
    else $("text").value = await file.text();
    $("file").value = "";
};
$("assign").onclick = () => {
    say("Working out the limits on this duct …");
    send({type: "assign", text: $("text").value});
};
$("keep").onclick = () => {
    const link = element("a");
    link.href = URL.createObjectURL(new Blob([$("text").value], {type: "application/toml"}));
    link.download = "exercise.toml";
    link.click();
    URL.revokeObjectURL(link.href);
};
$("start").onclick = () => send({type: "start"});
$("stop").onclick = () => send({type: "stop"});
$("standing").onchange = () => send({type: "standing", shown: $("standing").checked});
fitForm();
connect();
