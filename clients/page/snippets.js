// What does the same from a terminal or a program.
import { hasToken } from "./api.js";
import { element } from "./dom.js";

function curlLines(info, document, formats) {
    const token = hasToken() ? ' -H "Authorization: Bearer $GONIO_TOKEN"' : "";
    const lines = [];
    if (document) {
        for (const [file, part] of [["height_map", document.surface], ["environment_map", document.environment]])
            if (part?.sha256) lines.push(`curl${token} -T ${file} ${location.origin}/surfaces/${part.sha256}`);
        lines.push(`curl${token} -H 'Content-Type: application/json' -d '${JSON.stringify({ inputs: document })}' \\`,
            `     ${location.origin}/processes/${info.processID}/execution`);
    }
    for (const format of formats) lines.push(`curl${token} -o table.${format} '${location.origin}/jobs/${info.jobID}/results/table?f=${format}'`);
    return lines.join("\n");
}

// Python's own library alone: it runs where nothing was installed.
function pythonLines(info, document, formats) {
    const output = formats.length ? "table" : "report";
    const headers = hasToken() ? ', "Authorization": "Bearer " + os.environ["GONIO_TOKEN"]' : "";
    const lines = [`import json${hasToken() ? ", os" : ""}, urllib.request`, "", `server = "${location.origin}"`];
    lines.push("def call(path, body=None):",
        `    headers = {"Content-Type": "application/json", "Accept": "application/json"${headers}}`,
        "    data = json.dumps(body).encode() if body else None",
        "    return json.load(urllib.request.urlopen(urllib.request.Request(server + path, data, headers)))", "");
    if (document) {
        lines.push(`inputs = json.loads(r'''${JSON.stringify(document)}''')`,
            `job = call("/processes/${info.processID}/execution", {"inputs": inputs})`,
            'while job["status"] in ("accepted", "running"):', '    time.sleep(1)', '    job = call("/jobs/" + job["jobID"])',
            `${output} = call("/jobs/" + job["jobID"] + "/results/${output}")`);
        lines[0] += ", time";
    } else {
        lines.push(`${output} = call("/jobs/${info.jobID}/results/${output}")`);
    }
    return lines.join("\n");
}

function codeBlock(title, text) {
    const copy = element("button", { type: "button", onclick: () => navigator.clipboard.writeText(text).then(() => (copy.textContent = "Copied")) }, "Copy");
    return element("figure", { class: "code" }, element("figcaption", {}, title, navigator.clipboard ? copy : null), element("pre", { tabindex: 0 }, text));
}

/** `document`: of the job as accepted, or null if the server does not say it; `formats`: of its table. */
export function snippets(info, document, formats) {
    return element("div", {}, codeBlock("curl", curlLines(info, document, formats)), codeBlock("Python", pythonLines(info, document, formats)));
}
