// The page: which view is shown, whether the server is there, and the question for the token.
import { isFinished, onTokenNeeded } from "./api.js";
import { showComparison } from "./compare_view.js";
import { element } from "./dom.js";
import { showJob } from "./job_view.js";
import { makeJobsView } from "./jobs_view.js";
import { LiveJobs } from "./live.js";
import { makeSubmitView } from "./submit_view.js";

const find = (id) => document.getElementById(id);
const main = find("main");

function askForToken(refused) {
    const dialog = find("token-dialog"), field = find("token");
    find("token-error").textContent = refused ? "The server does not know this token." : "";
    field.value = "";
    if (!dialog.open) dialog.showModal();
    return new Promise((resolve) => {
        find("token-form").onsubmit = (event) => {
            event.preventDefault();
            if (!field.value.trim()) return;
            dialog.close();
            resolve(field.value.trim());
        };
    });
}
// Without a token there is nothing to go back to.
find("token-dialog").addEventListener("cancel", (event) => event.preventDefault());
onTokenNeeded(askForToken);

let countdown;
function showConnection(seconds) {
    const banner = find("connection");
    clearInterval(countdown);
    if (seconds === null) {
        banner.className = "back";
        find("connection-text").textContent = "The server is back.";
        find("connection-time").textContent = "";
        find("try-now").hidden = true;
        countdown = setTimeout(() => (banner.hidden = true), 4000);
        return;
    }
    const until = Date.now() + 1000 * seconds;
    const say = () => (find("connection-time").textContent = `Next try in ${Math.max(0, Math.ceil((until - Date.now()) / 1000))} s.`);
    banner.className = "lost";
    banner.hidden = false;
    // Only the first sentence is announced: the countdown would never let a screen reader be silent.
    find("connection-text").textContent = "Lost the server. Accepted jobs are safe with it.";
    find("try-now").hidden = false;
    say();
    countdown = setInterval(say, 500);
}

const live = new LiveJobs((jobs, more) => {
    jobsView.show(jobs, more);
    const open = jobs.filter((info) => !isFinished(info)).length;
    find("open-jobs").textContent = open || "";
    find("open-jobs").hidden = !open;
}, showConnection);
const jobsView = makeJobsView(live);
find("try-now").addEventListener("click", () => live.refresh());

// Made once, so that what was typed is still there when one comes back.
const submitView = makeSubmitView((info) => {
    live.refresh();
    location.hash = `#job=${info.jobID}`;
});

let leave = new AbortController();
async function showView() {
    leave.abort();
    leave = new AbortController();
    const { signal } = leave;
    const [, name, value] = /^#(\w+)=?(.*)$/.exec(location.hash) ?? [null, "new", ""];
    for (const link of document.querySelectorAll("nav a")) {
        if (link.hash === `#${name}`) link.setAttribute("aria-current", "page");
        else link.removeAttribute("aria-current");
    }
    const box = element("div");
    try {
        if (name === "jobs") box.append(jobsView.box);
        else if (name !== "job" && name !== "compare") box.append(element("div", { class: "head" }, element("h1", {}, "New measurement")), submitView);
        main.replaceChildren(box);
        if (name === "job") await showJob(box, value, signal);
        if (name === "compare") await showComparison(box, value.split(","));
    } catch (error) {
        if (signal.aborted) return;
        box.replaceChildren(element("p", { class: "card error", role: "alert" }, error.message),
            element("button", { type: "button", onclick: showView }, "Try again"));
    }
}
window.addEventListener("hashchange", () => {
    showView();
    main.focus();
});
showView();
live.run();
