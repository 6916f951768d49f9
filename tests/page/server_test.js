// The page and the server: progress, cancellation, tokens, a server that dies, the headers of its files.
import assert from "node:assert/strict";
import { after, before, describe, it } from "node:test";
import { screenshot, withPage } from "./browser.js";
import { longJob, planeJob, Service } from "./service.js";

describe("the page and its server", () => {
    let service;
    before(async () => (service = await Service.start()));
    after(() => service.stop());

    it("is sent with a strict policy and an ETag, to browsers alone", async () => {
        const answer = await fetch(`${service.url}/`, { headers: { Accept: "text/html,application/xhtml+xml,*/*;q=0.8" }, redirect: "manual" });
        assert.equal(answer.status, 303);
        assert.equal(answer.headers.get("Location"), "/page/");
        assert.equal((await service.json("/")).title, "gonio", "everyone else gets JSON");
        const page = await fetch(`${service.url}/page/`);
        assert.equal(page.headers.get("Content-Type"), "text/html; charset=utf-8");
        assert.equal(page.headers.get("Content-Security-Policy"), "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
            + "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
        assert.equal(page.headers.get("X-Content-Type-Options"), "nosniff");
        assert.equal(page.headers.get("Referrer-Policy"), "no-referrer");
        const again = await fetch(`${service.url}/page/`, { headers: { "If-None-Match": page.headers.get("ETag") } });
        assert.equal(again.status, 304);
        assert.equal((await fetch(`${service.url}/page/nothing.js`)).status, 404);
        assert.equal((await fetch(`${service.url}/page/..%2f..%2fREADME.md`)).status, 404);
    });

    it("says that there are no jobs yet", () => withPage(`${service.url}/page/#jobs`, async (page) => {
        await page.getByText("No jobs yet.").waitFor();
        await screenshot(page, "no_jobs");
    }));

    it("shows progress as it happens, and cancels", async () => {
        const { jobID } = await service.submit(longJob);
        await withPage(`${service.url}/page/#job=${jobID}`, async (page) => {
            await page.locator(".pill.running").waitFor();
            await page.getByText(/[1-9]\d* % · runs/).waitFor();
            await screenshot(page, "progress");
            await page.getByRole("link", { name: "Jobs" }).click();
            const row = page.locator(`[data-job="${jobID}"]`);
            await row.getByRole("progressbar").waitFor();
            assert.equal(await page.locator("#open-jobs").textContent(), "1");
            await row.getByRole("button", { name: "Cancel" }).click();
            await row.getByText("cancelled").waitFor();
            assert.equal((await service.json(`/jobs/${jobID}`)).status, "dismissed");
            await row.getByRole("link").click();
            await page.getByText("It was cancelled").waitFor();
        });
    });

    it("says that it lost the server, and finds it again", async () => {
        const { jobID } = await service.submit(longJob);
        await withPage(`${service.url}/page/#job=${jobID}`, async (page) => {
            await page.locator(".pill.running").waitFor();
            await service.kill();
            await page.getByText("Lost the server.").waitFor();
            await page.getByText(/Next try in \d+ s/).waitFor();
            // The page's clock jumps over its own next try and stops: a try that finds the server before the click
            // takes the button away, and four seconds later the banner.
            await page.clock.pauseAt(Date.now() + 60000);
            await screenshot(page, "lost");
            await service.restart();
            await page.getByRole("button", { name: "Try now" }).click();
            await page.getByText("The server is back.").waitFor();
            await page.clock.resume();
            // The events go on: what happens now is seen without a reload.
            await service.json(`/jobs/${jobID}`, { method: "DELETE" });
            await page.getByText("It was cancelled").waitFor();
        }, { prepare: (page) => page.clock.install(), allowed: [/ERR_CONNECTION|ERR_INCOMPLETE|ERR_EMPTY|ERR_CONTENT_LENGTH/] });
    });

    it("says that a job is not there", () => withPage(`${service.url}/page/#job=00ff`, async (page) => {
        await page.getByRole("alert").getByText("there is no job 00ff").waitFor();
    }, { allowed: [/status of 404/] }));
});

describe("a server with tokens", () => {
    let service;
    const token = "a-token-of-enough-length";
    before(async () => (service = await Service.start(`ann ${token}\n`)));
    after(() => service.stop());

    it("asks for the token, keeps it in the tab, and sends it with everything", () => withPage(`${service.url}/`, async (page) => {
        const field = page.getByLabel("Token", { exact: true });
        await field.waitFor();
        await screenshot(page, "token");
        await field.fill("not the right one at all");
        await page.keyboard.press("Enter");
        await page.getByText("The server does not know this token.").waitFor();
        await field.fill(token);
        await page.keyboard.press("Enter");
        await page.locator("dialog").waitFor({ state: "hidden" });
        await page.getByLabel("Relief").selectOption("plane");
        await page.getByRole("button", { name: "Measure", exact: true }).click();
        await page.getByRole("region", { name: "Files" }).waitFor();
        const started = page.waitForEvent("download");
        await page.getByRole("link", { name: /table\.csv/ }).click();
        assert.match((await started).suggestedFilename(), /table\.csv/);
        const lines = await page.locator("pre").first().textContent();
        assert.ok(lines.includes("$GONIO_TOKEN") && !lines.includes(token), "the token itself is in no line");
        await page.reload();
        await page.getByRole("region", { name: "Files" }).waitFor();
        assert.equal(await page.evaluate((secret) => Object.values(localStorage).includes(secret), token), false);
    }, { allowed: [/status of 401/] }));

    it("gives nothing but the page without one", async () => {
        assert.equal((await fetch(`${service.url}/page/main.js`)).status, 200);
        for (const path of ["/", "/jobs", "/processes", "/pages", "/page/../jobs"]) assert.equal((await fetch(service.url + path)).status, 401, path);
        const submitted = await fetch(`${service.url}/processes/brdf/execution`, { method: "POST", body: JSON.stringify({ inputs: planeJob(0.5) }) });
        assert.equal(submitted.status, 401);
    });
});
