// Every document of the given manifests against the schema of its kind, and mutants of each, which must be refused.
import fs from "node:fs";
import {createRequire} from "node:module";
import yaml from "js-yaml";

const require = createRequire(import.meta.url);

// undefined if it is valid, else what is wrong with it.
function fault(document) {
    const Model = require(`kubernetes-models/${document.apiVersion}/${document.kind}`)[document.kind];
    try {
        new Model(document).validate();
    } catch (error) {
        return error.message;
    }
}

// Mistakes that these schemas can see (not members that nobody knows), where the document has the place for them.
const mutants = {
    "a misspelt completionMode": (d) => d.spec.completionMode && (d.spec.completionMode = "Indxed"),
    "a container without a name": (d) => d.spec.template && delete d.spec.template.spec.containers[0].name,
    "a pod condition without its status": (d) => d.spec.podFailurePolicy && delete d.spec.podFailurePolicy.rules[0].onPodConditions[0].status,
    "a text for a number": (d) => d.spec.completions && (d.spec.completions = "many"),
    "one access mode in place of a list": (d) => d.spec.accessModes && (d.spec.accessModes = "ReadWriteMany"),
    "a port without its number": (d) => d.spec.ports && delete d.spec.ports[0].port,
};

let faults = 0;
for (const path of process.argv.slice(2)) {
    for (const document of yaml.loadAll(fs.readFileSync(path, "utf8"))) {
        const name = `${path}: ${document.kind} ${document.metadata.name}`;
        const found = fault(document);
        console.log(`${name}: ${found ?? "valid"}`);
        if (found) ++faults;
        for (const [what, mutate] of Object.entries(mutants)) {
            const mutant = structuredClone(document);
            if (!mutate(mutant)) continue;
            if (fault(mutant)) continue;
            console.log(`${name}: ${what} is not refused`);
            ++faults;
        }
    }
}
process.exit(faults ? 1 : 0);
