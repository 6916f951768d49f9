// The view of a job whose product is no table (a BTF, a light field, maps): its picture and what was done.
import { request } from "./api.js";
import { element } from "./dom.js";
import { percent } from "./format.js";
import { card } from "./result_view.js";

/** `results`: the document of GET /jobs/{id}/results. */
export function makePictureView(results, report) {
    const pictures = Object.entries(results).flatMap(([name, formats]) => formats.filter((one) => one.type === "image/png").map((one) => [name, one]));
    const images = pictures.map(([name, one]) => {
        const image = element("img", { alt: `Picture of ${name.replaceAll("_", " ")}`, class: "product" });
        // A link cannot carry the token.
        request(one.href).then((answer) => answer.blob()).then((blob) => {
            image.onload = () => URL.revokeObjectURL(image.src);
            image.src = URL.createObjectURL(blob);
        });
        return image;
    });
    const numbers = report.report;
    const facts = Object.entries(numbers?.settings ?? {}).map(([name, value]) => element("div", {}, element("dt", {}, name.replaceAll("_", " ")), element("dd", {}, value)));
    const error = numbers ? element("p", {}, `Relative error ${percent(numbers.relative_error)}. ${numbers.target_met ? "The target is met." : "The target was not reached."}`) : null;
    const warnings = [...(numbers?.warnings ?? []), ...(report.surface?.warnings ?? [])].map((text) => element("p", { class: "warning" }, text));
    return element("div", { class: "result" }, images.length ? card("Picture", images) : null, card("Numbers", error, element("dl", { class: "facts" }, facts), warnings));
}
