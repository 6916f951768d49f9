// Every view in light and dark, at the width of a phone: nothing sticks out, axe finds nothing serious.
import { after, before, describe, it } from "node:test";
import { assertAccessible, screenshot, withPage } from "./browser.js";
import { planeJob, richJob, Service } from "./service.js";

describe("for everybody", () => {
    let service, views;
    before(async () => {
        service = await Service.start();
        const rich = (await service.finish(richJob)).jobID, plane = (await service.finish(planeJob(0.5))).jobID;
        views = {
            new: ["#new", "form"], jobs: ["#jobs", ".jobs li"], job: [`#job=${rich}`, ".sphere"],
            compare: [`#compare=${rich},${plane}`, ".legend"],
        };
    });
    after(() => service.stop());

    for (const colorScheme of ["light", "dark"]) {
        it(`in ${colorScheme}, on a phone`, () => withPage(`${service.url}/page/`, async (page) => {
            for (const [name, [hash, ready]] of Object.entries(views)) {
                await page.goto(`${service.url}/page/${hash}`);
                await page.locator(ready).first().waitFor();
                await assertAccessible(page);
                await screenshot(page, `${name}_${colorScheme}_phone`);
            }
        }, { colorScheme, viewport: { width: 360, height: 740 } }));
    }
});
