// Fetches what the views of a finished job need.
import { getJson, linkOf } from "./api.js";
import { bytes } from "./format.js";
import { Table } from "./table.js";

// A table above this is for downloading: as JSON, a browser would need several times as much memory.
const mostBytes = 64e6;

/** {results, report, document, table}; `document` is null where the server does not say it, `table` is null
 *  for jobs whose product is no table, and has {tooLarge} in place of values where it is beyond a page. */
export async function loadResult(info) {
    const results = await getJson(`/jobs/${info.jobID}/results`);
    const href = linkOf(info, "describedby");
    const json = results.table?.find((one) => one.type === "application/json");
    const [report, document, table] = await Promise.all([
        getJson(`/jobs/${info.jobID}/results/report`),
        href ? getJson(href) : null,
        !json ? null : json.bytes > mostBytes ? { tooLarge: bytes(json.bytes) } : getJson(json.href).then((content) => new Table(content)),
    ]);
    return { results, report, document, table };
}
