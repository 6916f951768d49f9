// What is seen of a finished job, held against the table that the server gives and against closed forms.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, before, describe, it } from "node:test";
import { brightness, screenshot, withPage } from "./browser.js";
import { planeJob, richJob, Service, sha256 } from "./service.js";

const region = (page, name) => page.getByRole("region", { name, exact: true });
const lobe = (page, k = 0) => page.locator(`.plot .lobe.series-${k}`).getAttribute("d");

/** f and sigma out of the JSON table, independent of the page's code. */
function lookUp(table, channel, order, wi, wo) {
    const [, orders, nIn, nOut] = table.shape;
    const find = (axis, [theta, phi]) => table.axes.find(({ name }) => name === axis).values.findIndex(([t, p]) => t === theta && p === phi);
    const k = ((channel * orders + order) * nIn + find("incident", wi)) * nOut + find("outgoing", wo);
    return { f: table.values[k], sigma: Math.hypot(table.standard_error[k], table.bias[k]) };
}

/** "0.1234 ± 0.0012" is f ± sigma, to the digits that it shows. */
function assertShows(text, { f, sigma }) {
    const [, value, error] = /(-?[\d.]+(?:e-?\d+)?) ± ([\d.]+(?:e-?\d+)?)/.exec(text) ?? assert.fail(`no value with error: ${text}`);
    const digit = 10 ** -(value.split(".")[1]?.length ?? 0);
    assert.ok(Math.abs(value - f) <= 0.51 * digit, `${text} against f = ${f}`);
    assert.ok(Math.abs(error - sigma) <= Math.max(0.51 * digit, 0.05 * sigma), `${text} against sigma = ${sigma}`);
}

describe("a result", () => {
    let service, rich, table, planes;
    before(async () => {
        service = await Service.start();
        rich = await service.finish(richJob);
        table = await service.table(rich.jobID);
        planes = [await service.finish(planeJob(0.5)), await service.finish(planeJob(0.4))];
    });
    after(() => service.stop());
    const at = (info) => `${service.url}/page/#job=${info.jobID}`;

    it("has lobes with their errors, which follow the sliders", () => withPage(at(rich), async (page) => {
        await region(page, "Sphere").waitFor();
        await screenshot(page, "result");
        const theta = page.getByLabel("Light θ"), phi = page.getByLabel("Light φ");
        await page.getByText("The values", { exact: true }).click();
        const shown = () => region(page, "Lobes in the plane of incidence").getByRole("row", { name: /^-40°/ }).textContent();
        assert.equal(await theta.getAttribute("aria-valuetext"), "theta 30 degrees");
        // -40 degrees: on the side of the light, so at its own azimuth.
        assertShows(await shown(), lookUp(table, 0, 0, [30, 0], [40, 0]));
        const first = await lobe(page);
        await theta.fill("2");
        assert.notEqual(await lobe(page), first);
        assertShows(await shown(), lookUp(table, 0, 0, [60, 0], [40, 0]));
        await phi.fill("1");
        assert.equal(await phi.getAttribute("aria-valuetext"), "phi 90 degrees");
        assertShows(await shown(), lookUp(table, 0, 0, [60, 90], [40, 90]));
        await page.getByLabel("Channel", { exact: true }).selectOption("b");
        assertShows(await shown(), lookUp(table, 2, 0, [60, 90], [40, 90]));
        await page.getByLabel("Light", { exact: true }).selectOption("order 2");
        assertShows(await shown(), lookUp(table, 2, 2, [60, 90], [40, 90]));
        const linear = await lobe(page);
        await page.getByLabel("Scale", { exact: true }).selectOption("logarithmic");
        assert.notEqual(await lobe(page), linear);
        const band = () => page.locator(".plot .band").getAttribute("d");
        const narrow = await band();
        await page.getByLabel("Error band", { exact: true }).selectOption("± 100 σ");
        assert.notEqual(await band(), narrow);
    }));

    it("has a hemisphere map that says the value under the pointer and under the keys", () => withPage(at(rich), async (page) => {
        const map = region(page, "Hemisphere"), canvas = map.locator("canvas").first();
        await canvas.waitFor();
        const { width, height } = await canvas.boundingBox();
        // theta 40, phi 90: above the centre by sin 40 of the radius.
        await canvas.hover({ position: { x: width / 2, y: (height / 2) * (1 - Math.sin((40 * Math.PI) / 180)) } });
        assert.match(await map.getByRole("status").textContent(), /^θ 40°, φ 90°/);
        assertShows(await map.getByRole("status").textContent(), lookUp(table, 0, 0, [30, 0], [40, 90]));
        await canvas.focus();
        await page.keyboard.press("ArrowRight");
        assert.match(await map.getByRole("status").textContent(), /^θ 40°, φ 120°/);
        const colours = await canvas.screenshot();
        await page.getByLabel("Light θ").fill("2");
        assert.ok(!colours.equals(await canvas.screenshot()), "the colours follow the slider");
    }));

    it("splits the orders", () => withPage(at(rich), async (page) => {
        const rows = region(page, "Orders of scattering").locator("tbody tr");
        await rows.first().waitFor();
        const parts = (await rows.locator("td:nth-of-type(2)").allTextContents()).map(parseFloat);
        assert.ok(parts.length >= 3 && parts[0] > parts[1] && parts[1] > parts[2], parts.join());
        assert.ok(Math.abs(parts.reduce((a, b) => a + b) - 100) < 1.5, parts.join());
    }));

    it("knows the albedo of a plane, and that it is reciprocal", () => withPage(at(planes[0]), async (page) => {
        const numbers = region(page, "Numbers");
        await numbers.waitFor();
        const [albedo, reciprocity] = await numbers.locator("dd").allTextContents();
        assert.match(albedo, /^0\.5 ± 0/);
        assert.match(reciprocity, /^0 % rms.* in 10 pairs/);
        await page.getByText("This table has the sum of all orders.").waitFor();
    }));

    it("says where it cannot integrate", async () => {
        const info = await service.finish({ ...planeJob(0.5), measure: { kind: "brdf", pairs_deg: [[0, 0, 30, 0], [0, 0, 60, 180], [30, 0, 0, 0]] } });
        await withPage(at(info), async (page) => {
            await region(page, "Numbers").getByText("no weights, no full grid").waitFor();
            await region(page, "Sphere").getByText("this table has pairs").waitFor();
        });
    });

    it("lights a sphere from the side that the slider says", () => withPage(at(rich), async (page) => {
        const canvas = region(page, "Sphere").locator("canvas");
        await canvas.waitFor();
        await page.getByLabel("Light, left to right").fill("-60");
        const [left, right] = await brightness(page, canvas);
        assert.ok(left > 1.3 * right && left > 40, `${left} and ${right}`);
        await page.getByLabel("Light, left to right").fill("60");
        const moved = await brightness(page, canvas);
        assert.ok(moved[1] > 1.3 * moved[0], moved.join());
        await canvas.hover({ position: { x: 20, y: 100 } });
        await page.mouse.down();
        await canvas.hover({ position: { x: 30, y: 100 } });
        await page.mouse.up();
        assert.ok(Number(await page.getByLabel("Light, left to right").inputValue()) < -60, "dragged to the left");
    }));

    it("says that the sphere needs WebGL", () => withPage(at(rich), async (page) => {
        await region(page, "Sphere").getByText("This browser has no WebGL 2").waitFor();
        await region(page, "Hemisphere").locator("canvas").first().waitFor();
    }, {
        prepare: (page) => page.addInitScript(() => {
            const original = HTMLCanvasElement.prototype.getContext;
            HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
                return kind.startsWith("webgl") ? null : original.call(this, kind, ...rest);
            };
        }),
    }));

    it("gives every file that the server lists, and the lines that fetch them", () => withPage(at(rich), async (page) => {
        const results = await service.json(`/jobs/${rich.jobID}/results`);
        const listed = Object.values(results).flat();
        await region(page, "Files").waitFor();
        assert.equal(await region(page, "Files").getByRole("link").count(), listed.length);
        for (const { href, sha256: wanted } of listed) {
            const started = page.waitForEvent("download");
            await page.locator(`a[href="${href}"]`).click();
            assert.equal(sha256(await readFile(await (await started).path())), wanted, href);
        }
        const lines = await region(page, "The same from a terminal").locator("pre").allTextContents();
        for (const format of ["csv", "json", "exr"]) assert.ok(lines[0].includes(`${service.url}/jobs/${rich.jobID}/results/table?f=${format}`));
        assert.match(lines[1], /urllib\.request/);
    }));

    it("is compared with another", () => withPage(`${service.url}/page/#jobs`, async (page) => {
        const compare = page.getByRole("link", { name: "Compare two" });
        for (const { jobID } of planes) await page.getByLabel(`Compare job ${jobID.slice(0, 8)}`).check();
        await screenshot(page, "jobs");
        await compare.click();
        const numbers = region(page, "How far apart");
        await numbers.waitFor();
        // 0.5 against 0.4: apart by 0.1 of 0.45, everywhere.
        assert.match(await numbers.textContent(), /Difference, rms22 %/);
        assert.match(await numbers.textContent(), /Within 1, 2, 3 σ0 %, 0 %, 0 %/);
        assert.notEqual(await lobe(page, 0), await lobe(page, 1));
        assert.equal(await page.locator(".legend li").count(), 2);
        await screenshot(page, "compare");
        const same = planes[0].jobID;
        await page.goto(`${service.url}/page/#compare=${same},${same}`);
        await numbers.getByText("100 %, 100 %, 100 %").waitFor();
    }));
});
