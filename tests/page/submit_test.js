// From an idea to an accepted job: the form, height maps, the preview, errors at their fields.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, before, describe, it } from "node:test";
import { screenshot, withPage } from "./browser.js";
import { Service, sha256 } from "./service.js";

const mapPath = new URL(`${process.env.SAMPLES}/lava_rock_256_16bit.png`, "file://");

// A height map dropped anywhere on the form.
async function drop(page, name, bytes) {
    const transfer = await page.evaluateHandle(([fileName, content]) => {
        const list = new DataTransfer();
        list.items.add(new File([Uint8Array.from(atob(content), (c) => c.charCodeAt(0))], fileName));
        return list;
    }, [name, bytes.toString("base64")]);
    await page.dispatchEvent("form[aria-label='New measurement']", "drop", { dataTransfer: transfer });
}

const measure = (page) => page.getByRole("button", { name: "Measure", exact: true });
const sentInputs = (page) => page.waitForRequest((request) => request.url().endsWith("/processes/brdf/execution")).then((request) => request.postDataJSON().inputs);

describe("submitting", () => {
    let service;
    before(async () => (service = await Service.start()));
    after(() => service.stop());

    it("measures what the form says", () => withPage(`${service.url}/`, async (page) => {
        assert.equal(new URL(page.url()).pathname, "/page/", "a browser is sent from / to the page");
        await screenshot(page, "new");
        await page.getByLabel("Relief").selectOption("v_groove");
        await page.getByLabel("Points along x").fill("32");
        await page.getByLabel("Period", { exact: true }).fill("0.5");
        await page.getByLabel("Unit of Period").selectOption("mm");
        await page.getByLabel("Seen from").selectOption("hemisphere");
        await page.getByLabel("In the table").selectOption("separate");
        await page.getByLabel("Orders of scattering").fill("2");
        const sent = sentInputs(page);
        await measure(page).click();
        assert.deepEqual(await sent, {
            surface: { generate: "v_groove", samples: 32, period: "0.5 mm", slope_deg: 45 },
            material: { model: "lambertian", albedo: 0.8 },
            measure: { kind: "brdf", incident: { theta_deg: [0, 15, 30, 45, 60, 75], phi_deg: [0] }, outgoing: { hemisphere: 64 }, max_order: 2, orders: "separate" },
            accuracy: { target_relative_error: 0.01, seed: 1 },
        });
        await page.getByRole("region", { name: "Lobes in the plane of incidence" }).waitFor();
        await page.getByText("No outgoing direction lies in the plane of incidence").waitFor();
    }));

    it("shows an error of the server at its field, and only there", () => withPage(`${service.url}/page/`, async (page) => {
        const albedo = page.getByLabel("Albedo", { exact: true }), theta = page.getByLabel("θ from the normal, degrees").first();
        await albedo.fill("1.5");
        await measure(page).click();
        await page.getByText("must be a number from 0 to 1").waitFor();
        assert.equal(await page.locator("[aria-invalid]").count(), 1);
        assert.equal(await albedo.getAttribute("aria-invalid"), "true");
        assert.ok(await albedo.evaluate((field) => field === document.activeElement), "the focus is on it");
        assert.match(await albedo.evaluate((field) => document.getElementById(field.getAttribute("aria-describedby").split(" ")[0]).textContent), /^1\.5: must be/);
        await screenshot(page, "field_error");
        await albedo.fill("0.5");
        await theta.fill("0, 95");
        await measure(page).click();
        await page.locator("[data-pointer='/inputs/measure/incident/theta_deg'] [aria-invalid]").waitFor();
        assert.equal(await page.locator("[aria-invalid]").count(), 1);
        await theta.fill("0, x");
        await measure(page).click();
        await page.getByText("\"x\"").waitFor();
        assert.equal((await service.json("/jobs?limit=100")).jobs.filter((job) => job.status !== "successful").length, 0, "nothing was accepted");
    }, { allowed: [/status of 400/] }));

    it("takes a dropped height map without crypto.subtle, asks for its units, previews and measures it", async () => {
        const map = await readFile(mapPath);
        const hash = sha256(map);
        const prepare = (page) => page.addInitScript(() => Object.defineProperty(crypto, "subtle", { value: undefined }));
        await withPage(`${service.url}/page/`, async (page) => {
            await drop(page, "lava.png", map);
            await page.locator("[data-pointer='/inputs/surface/width'] .error", { hasText: "does not carry this length" }).waitFor();
            const stored = await fetch(`${service.url}/surfaces/${hash}`);
            assert.equal(sha256(Buffer.from(await stored.arrayBuffer())), hash, "the map arrived whole");
            await page.getByLabel("Width of the whole map", { exact: true }).fill("50");
            await page.getByLabel("Height range", { exact: true }).fill("5");
            await page.getByRole("button", { name: "Preview the surface" }).click();
            const image = page.getByAltText("Hillshade of the surface");
            await image.waitFor();
            assert.equal(await image.evaluate((shown) => shown.decode().then(() => shown.naturalWidth)), 256);
            await page.getByText("256 × 256").waitFor();
            await page.getByText("50 mm × 50 mm").waitFor();
            await page.getByText("Steepest slope").waitFor();
            await screenshot(page, "preview");
            await page.getByLabel("Target relative error").fill("0.2");
            const sent = sentInputs(page);
            await measure(page).click();
            assert.deepEqual((await sent).surface, { sha256: hash, width: "50 mm", height_range: "5 mm", boundary: "periodic", level: "none" });
            await page.waitForURL(/#job=/);
        }, { prepare, allowed: [/status of 40[04]/] });
    });

    it("takes a chosen height map with crypto.subtle", () => withPage(`${service.url}/page/`, async (page) => {
        await page.getByText("Height map", { exact: true }).click();
        await page.setInputFiles("#height-map", { name: "one.bin", mimeType: "application/octet-stream", buffer: Buffer.from("not a picture") });
        await page.getByText("one.bin, 13 B").waitFor();
        assert.equal((await fetch(`${service.url}/surfaces/${sha256("not a picture")}`)).status, 200);
        await page.getByText("is not a number").first().waitFor();
    }, { allowed: [/status of 40[04]/] }));

    const few = async (page, ...names) => {
        for (const name of names) await page.locator(`[data-pointer='/inputs/measure/${name}/theta_deg'] input`).fill("0, 40");
        if (names.includes("outgoing")) await page.locator("[data-pointer='/inputs/measure/outgoing/phi_deg'] input").fill("0");
    };
    const small = async (page) => {
        await page.goto(`${service.url}/page/`);
        await page.getByLabel("Points along x").fill("24");
        await page.getByLabel("Target relative error").fill("0.1");
    };
    // These tests leave a page for the next measurement while it still asks for its jobs.
    const leaving = { allowed: [/Failed to fetch/] };
    const sentTo = (page, process) => page.waitForRequest((request) => request.url().endsWith(`/processes/${process}/execution`))
        .then((request) => request.postDataJSON().inputs);
    const angles = { theta_deg: [0, 40], phi_deg: [0] };

    it("measures every kind, and shows it", () => withPage(`${service.url}/page/`, async (page) => {
        const kinds = [
            ["projection", "brdf", ["incident"], { incident: angles, max_order: "all", project: { basis: "hsh", order: 4 } }],
            ["btf", "btf", ["incident", "outgoing"], { incident: angles, outgoing: angles, max_order: "all", pixels: [12, 12] }],
            ["light_field", "light_field", ["incident", "outgoing"], { incident: angles, outgoing: angles, max_order: "all" }],
            ["environment_field", "light_field", ["outgoing"], { outgoing: angles, max_order: "all", azimuths: 16 }],
            ["maps", "maps", ["incident", "outgoing"], { incident: angles, outgoing: angles, max_order: "all", sky_directions: 32 }],
            ["relight", "relight", ["outgoing"], { outgoing: angles, max_order: "all", azimuths: 16 }]];
        for (const [choice, process, directions, measured] of kinds) {
            await small(page);
            await page.getByLabel("What", { exact: true }).selectOption(choice);
            await few(page, ...directions);
            if (choice === "projection") await page.getByLabel("Order", { exact: true }).fill("4");
            if (choice === "btf") await page.getByLabel("Pixels, columns and rows").fill("12 12");
            if (choice === "maps") await page.getByLabel("Directions of the sky").fill("32");
            if (choice === "relight") await screenshot(page, "new_relight");
            const sent = sentTo(page, process);
            await measure(page).click();
            const inputs = await sent;
            assert.deepEqual(inputs.measure, { kind: process, ...measured });
            assert.deepEqual(inputs.environment, ["relight", "environment_field"].includes(choice) ? { radiance: 1 } : undefined);
            if (choice === "projection") await page.getByRole("region", { name: "Sphere", exact: true }).waitFor();
            else await page.getByRole("img", { name: `Picture of ${process.replaceAll("_", " ")}` }).waitFor();
        }
    }, leaving));

    it("takes every material, curved bases and receiver cells as far as the server does", () => withPage(`${service.url}/page/`, async (page) => {
        const expected = {
            colour: { model: "lambertian", albedo: [0.8, 0.5, 0.3] },
            phong: { model: "phong", exponent: 20, albedo: 0.8 },
            blinn_phong: { model: "blinn_phong", exponent: 20, albedo: 0.8 },
            ggx_metal: { model: "ggx", alpha: 0.3, metal: "Al" },
            ggx: { model: "ggx", alpha: 0.3, reflectance: 1 },
            beckmann_metal: { model: "beckmann", alpha: 0.3, metal: "Al" },
            brushed: { model: "ggx", alpha_x: 0.1, alpha_y: 0.4, rotation_deg: 0, metal: "Al" },
            coated_diffuse: { model: "coated_diffuse", eta: 1.5, alpha: 0.1, albedo: 0.8 },
            mixture: { model: "mixture", parts: [{ weight: 0.5, model: "lambertian", albedo: 0.8 }, { weight: 0.5, model: "ggx", alpha: 0.3, reflectance: 1 }] },
        };
        for (const [name, material] of Object.entries(expected)) {
            await small(page);
            await few(page, "incident", "outgoing");
            await page.getByLabel("Facets").selectOption(name);
            const sent = sentTo(page, "brdf");
            await measure(page).click();
            assert.deepEqual((await sent).material, material);
            await page.waitForURL(/#job=/);
        }
        await small(page);
        await few(page, "incident");
        await page.getByLabel("Facets").selectOption("mirror");
        await page.getByLabel("Seen from").selectOption("equal_cells");
        let sent = sentTo(page, "brdf");
        await measure(page).click();
        assert.deepEqual((await sent).measure.outgoing, { cells: { equal: 64 } });
        await page.waitForURL(/#job=/);
        await small(page);
        await few(page, "incident", "outgoing");
        await page.getByLabel("It stands on").selectOption("curved");
        sent = sentTo(page, "brdf");
        await measure(page).click();
        assert.deepEqual((await sent).base, { kappa_1: 10, kappa_2: 0, direction_deg: 0 });
        await page.waitForURL(/#job=/);
    }, leaving));

    it("lights with an uploaded environment", () => withPage(`${service.url}/page/`, async (page) => {
        const sky = Buffer.concat([Buffer.from("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"), Buffer.from(Array.from({ length: 128 }, (_, k) => 96 + k % 32))]);
        await small(page);
        await page.getByLabel("What", { exact: true }).selectOption("relight");
        await few(page, "outgoing");
        await page.getByText("Map", { exact: true }).click();
        await page.setInputFiles("#environment-map", { name: "sky.hdr", mimeType: "application/octet-stream", buffer: sky });
        await page.getByText(`sky.hdr, ${sky.length} B`).waitFor();
        await page.getByLabel("Brightness times").fill("2");
        const sent = sentTo(page, "relight");
        await measure(page).click();
        assert.deepEqual((await sent).environment, { sha256: sha256(sky), rotation_deg: 0, scale: 2 });
        await page.getByAltText("Picture of relight").waitFor();
    }, { allowed: [...leaving.allowed, /status of 404/] }));

    it("hashes like everybody else", () => withPage(`${service.url}/page/`, async (page) => {
        for (const size of [0, 1, 55, 56, 63, 64, 65, 119, 120, 1000, 70001]) {
            const own = await page.evaluate(async (n) => {
                const { sha256InScript } = await import("/page/sha256.js");
                return sha256InScript(Uint8Array.from({ length: n }, (_, k) => (k * 7 + n) % 256));
            }, size);
            assert.equal(own, sha256(Uint8Array.from({ length: size }, (_, k) => (k * 7 + size) % 256)), `${size} bytes`);
        }
    }));

    it("can be done with the keyboard alone", () => withPage(`${service.url}/page/`, async (page) => {
        // Tab until the focus is where the test wants it: nothing else moves it.
        const tabTo = async (label) => {
            for (let presses = 0; presses < 60; presses++) {
                const name = await page.evaluate(() => document.activeElement.labels?.[0]?.textContent ?? document.activeElement.textContent);
                if (name === label) return;
                await page.keyboard.press("Tab");
            }
            assert.fail(`no way to ${label}`);
        };
        await tabTo("Generated");
        await page.keyboard.press("ArrowRight");
        await page.getByText("Choose a height map").waitFor();
        await page.keyboard.press("ArrowLeft");
        await tabTo("Relief");
        await page.keyboard.type("V-g");
        await tabTo("Points along x");
        await page.keyboard.press("Control+A");
        await page.keyboard.type("16");
        await tabTo("Measure");
        await page.keyboard.press("Enter");
        await page.getByRole("region", { name: "Sphere", exact: true }).waitFor();
        await tabTo("Light θ");
        const before = await page.locator(".plot .lobe").getAttribute("d");
        await page.keyboard.press("ArrowRight");
        assert.notEqual(await page.locator(".plot .lobe").getAttribute("d"), before);
    }));
});
