// Files of a result: every output in every format that the server lists.
import { hasToken, request } from "./api.js";
import { element } from "./dom.js";
import { bytes } from "./format.js";

const formatOf = (href) => new URL(href, location).searchParams.get("f");

/** Formats of the output "table"; none of a job whose product is no table. */
export function tableFormats(results) {
    return (results.table ?? []).map((one) => formatOf(one.href));
}

// A link cannot carry the token, so the file is fetched and handed over.
async function save(event, href, name) {
    if (!hasToken()) return;
    event.preventDefault();
    const url = URL.createObjectURL(await (await request(href)).blob());
    element("a", { href: url, download: name }).click();
    URL.revokeObjectURL(url);
}

/** `results`: the document of GET /jobs/{id}/results. */
export function downloads(results) {
    const link = (output, one) => {
        const name = `${output}.${formatOf(one.href)}`;
        return element("a", { class: "button", href: one.href, download: name, title: `SHA-256 ${one.sha256}`, onclick: (event) => save(event, one.href, name) },
            name, element("span", { class: "hint" }, bytes(one.bytes)));
    };
    return element("div", { class: "downloads" }, Object.entries(results).map(([output, formats]) => formats.map((one) => link(output, one))).flat());
}
