// One job: its progress, then its result.
import { getJson, isFinished } from "./api.js";
import { downloads, tableFormats } from "./downloads.js";
import { element } from "./dom.js";
import { followJob } from "./events.js";
import { clock } from "./format.js";
import { cancelButton, progressOf, statusPill } from "./jobs_view.js";
import { loadResult } from "./result.js";
import { makePictureView } from "./picture_view.js";
import { card, makeResultView } from "./result_view.js";
import { snippets } from "./snippets.js";

function describe(document) {
    if (!document) return null;
    const { surface, material } = document;
    if (!material) return "height map";
    const spaced = (name) => name.replaceAll("_", " ");
    const facets = material.model === "lambertian" ? `albedo ${JSON.stringify(material.albedo)}` : spaced(material.model);
    return `${surface.generate ? spaced(surface.generate) : "height map"}, ${facets}`;
}

async function showResult(box, info) {
    box.replaceChildren(element("p", { class: "quiet", role: "status" }, "Fetching the result …"));
    const { results, report, document, table } = await loadResult(info);
    const views = !table ? makePictureView(results, report) : table.tooLarge
        ? element("p", { class: "card quiet" }, `The table has ${table.tooLarge}: too much to draw here. Download it below.`)
        : makeResultView(table, report);
    box.replaceChildren(element("p", { class: "quiet" }, describe(document)), views, element("div", { class: "stack" }, card("Files", downloads(results),
        element("p", { class: "hint" }, `Job hash ${info.job_hash}`)), card("The same from a terminal", snippets(info, document, tableFormats(results)))));
}

/** Fills `box` and keeps it fresh until `signal` aborts. */
export async function showJob(box, id, signal) {
    const head = element("div", { class: "head" });
    const body = element("div");
    const announcement = element("p", { class: "visually-hidden", role: "status" });
    box.replaceChildren(head, announcement, body);
    let status;
    const show = (info) => {
        head.replaceChildren(element("h1", {}, "Job ", element("span", { class: "mono" }, id.slice(0, 8))), statusPill(info), element("time", { class: "quiet" }, clock(info.created)));
        // Said once a change, not at every percent.
        if (status !== info.status) announcement.textContent = `The job is ${info.status}.`;
        status = info.status;
        if (!isFinished(info)) body.replaceChildren(element("div", { class: "card" }, progressOf(info), cancelButton(info, () => {})));
    };
    let info = await getJson(`/jobs/${id}`, { signal });
    show(info);
    if (!isFinished(info)) {
        await followJob(id, (update) => show((info = update)), signal);
    }
    if (signal.aborted) return;
    if (info.status === "successful") await showResult(body, info);
    else body.replaceChildren(element("p", { class: "card quiet" }, info.status === "failed" ? `It failed: ${info.message}` : "It was cancelled; nothing was kept to show."));
}
