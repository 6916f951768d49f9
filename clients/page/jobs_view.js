// The job list.
import { cancel, isFinished } from "./api.js";
import { element } from "./dom.js";
import { clock, duration, percent } from "./format.js";

const words = { accepted: "waiting", running: "running", successful: "done", failed: "failed", dismissed: "cancelled" };

export function statusPill(info) {
    return element("span", { class: `pill ${info.status}` }, words[info.status]);
}

/** Bar and words for a job that has not ended. */
export function progressOf(info) {
    const stage = info.message || (info.status === "accepted" ? "waiting for its turn" : "starting");
    const parts = [`${info.progress} %`, stage, info.relative_error ? `${percent(info.relative_error)} error so far` : null,
        info.seconds_left !== undefined ? `about ${duration(info.seconds_left)} left` : null];
    return element("div", { class: "progress" },
        element("progress", { max: 100, value: info.progress, "aria-label": "Progress" }), element("span", {}, parts.filter(Boolean).join(" · ")));
}

export function cancelButton(info, onDone) {
    const button = element("button", { type: "button", onclick: async () => {
        button.disabled = true;
        await cancel(info.jobID).catch(() => (button.disabled = false));
        onDone();
    } }, "Cancel");
    return button;
}

/** What a job says of itself when it is over. */
function outcome(info) {
    if (info.status === "failed") return info.message;
    const took = info.started && info.finished ? duration((Date.parse(info.finished) - Date.parse(info.started)) / 1000) : "";
    const error = info.relative_error ? `${percent(info.relative_error)} error` : "";
    return [error, took && `in ${took}`, info.owner && `by ${info.owner}`].filter(Boolean).join(" · ");
}

/** The list; `live`: LiveJobs. show(jobs, more) draws it. */
export function makeJobsView(live) {
    const chosen = new Set();
    const list = element("ul", { class: "jobs" });
    const compare = element("a", { class: "button", role: "link" }, "Compare two");
    const more = element("button", { type: "button", onclick: () => live.showMore() }, "Show older jobs");
    const hint = element("span", { class: "hint" });
    const showChoice = () => {
        const ready = chosen.size === 2;
        if (ready) compare.setAttribute("href", `#compare=${[...chosen].join(",")}`);
        else compare.removeAttribute("href");
        compare.setAttribute("aria-disabled", String(!ready));
        hint.textContent = ready ? "" : "Tick two finished jobs to compare them.";
    };
    const tick = (info) => element("input", {
        type: "checkbox", "aria-label": `Compare job ${info.jobID.slice(0, 8)}`, checked: chosen.has(info.jobID), disabled: info.status !== "successful",
        onchange: (event) => {
            if (event.target.checked) chosen.add(info.jobID);
            else chosen.delete(info.jobID);
            showChoice();
        },
    });
    const row = (info) => element("li", { "data-job": info.jobID }, tick(info),
        element("a", { href: `#job=${info.jobID}`, class: "name" }, info.jobID.slice(0, 8), element("span", { class: "hint" }, info.processID)),
        statusPill(info), element("time", { datetime: info.created }, clock(info.created)),
        element("div", { class: "state" }, isFinished(info) ? outcome(info) : progressOf(info)),
        isFinished(info) ? null : cancelButton(info, () => live.refresh()));
    // Rows are drawn again only where something changed, so that the focus stays where it is.
    const drawn = new Map();
    const show = (jobs, hasMore) => {
        if (jobs.length === 0) {
            list.replaceChildren(element("li", { class: "empty" }, element("p", {}, "No jobs yet."), element("a", { class: "button primary", href: "#new" }, "Measure something")));
            drawn.clear();
        } else {
            list.replaceChildren(...jobs.map((info) => {
                const text = JSON.stringify(info);
                if (drawn.get(info.jobID)?.text !== text) drawn.set(info.jobID, { text, box: row(info) });
                return drawn.get(info.jobID).box;
            }));
        }
        more.hidden = !hasMore;
    };
    showChoice();
    more.hidden = true;
    const box = element("section", { "aria-label": "Jobs" }, element("div", { class: "head" }, element("h1", {}, "Jobs"), element("div", { class: "actions" }, hint, compare)), list, more);
    return { box, show };
}
