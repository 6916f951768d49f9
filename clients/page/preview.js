// A look at the surface before it is sent: hillshade and statistics from the server's process "statistics".
import { execute, getJson, Problem, request } from "./api.js";
import { element } from "./dom.js";
import { length, plain } from "./format.js";

// What is shown of the report, if it is there.
const rows = [
    ["Points", (r) => r.nx && `${r.nx} × ${r.ny}`],
    ["Size", (r) => r.width_m && `${length(r.width_m)} × ${length(r.depth_m)}`],
    ["Pitch", (r) => r.pitch_x_m && `${length(r.pitch_x_m)} × ${length(r.pitch_y_m)}`],
    ["Height, rms", (r) => r.sq_m !== undefined && length(r.sq_m)],
    ["Slope, rms in x and y", (r) => r.rms_slope_x !== undefined && `${plain(r.rms_slope_x)}, ${plain(r.rms_slope_y)}`],
    ["Steepest slope", (r) => r.max_slope !== undefined && `${plain((Math.atan(r.max_slope) * 180) / Math.PI)}°`],
    ["Jump at the seam", (r) => r.wrap_jump_x !== undefined && `${plain(r.wrap_jump_x)}, ${plain(r.wrap_jump_y)} (1 is seamless)`],
];

async function statistics(surface) {
    const info = await execute("statistics", { surface }, { Prefer: "wait=10" });
    if (info.status !== "successful") throw new Error(info.message || "The preview is not ready: the server is busy.");
    const results = `/jobs/${info.jobID}/results`;
    const [report, picture] = await Promise.all([getJson(`${results}/report`), request(`${results}/hillshade`)]);
    return { report, picture: await picture.blob() };
}

/** Fills `box`. Throws Problem for what the form should show at its fields. */
export async function showPreview(box, surface) {
    box.replaceChildren(element("p", { class: "quiet" }, "Looking at the surface …"));
    try {
        const { report, picture } = await statistics(surface);
        const image = element("img", { src: URL.createObjectURL(picture), alt: "Hillshade of the surface" });
        image.addEventListener("load", () => URL.revokeObjectURL(image.src));
        const known = rows.map(([name, text]) => [name, text(report)]).filter(([, text]) => text);
        box.replaceChildren(image,
            element("dl", {}, known.map(([name, text]) => element("div", {}, element("dt", {}, name), element("dd", {}, text)))),
            ...(report.warnings ?? []).map((text) => element("p", { class: "warning" }, text)));
    } catch (error) {
        const missing = error instanceof Problem && error.status === 404;
        box.replaceChildren(element("p", { class: "quiet" }, missing ? "This server makes no previews." : error.message));
        if (error instanceof Problem && !missing) throw error;
    }
}
