"""Dependencies go one way, and every third-party header has its homes: both are read off the #include lines."""
import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1])

# Within core, a folder may include itself and what stands to its left.
CORE = ["base", "directions", "surface", "material", "visibility", "scattering", "table", "measure"]
# Between the top folders: whom each may include.
TOP = {"core": {"core"}, "fitting": {"core", "fitting"}, "server": {"core", "fitting", "server"},
       "clients": {"core", "fitting", "server", "clients"}}
# Third-party headers and the only places that may name them.
HOMES = {
    r"embree": ["core/scattering/embree_scene"],
    r"ceres/": ["fitting/"],
    r"httplib": ["server/http", "clients/cli/remote.cpp"],
    r"nlohmann/": ["server/", "core/table/io/json.cpp", "clients/cli/"],
    r"hwy/": ["core/visibility/march.cpp", "core/visibility/horizon_sweep.cpp", "core/visibility/grid_tracer.cpp",
             "core/scattering/kernels.cpp", "core/scattering/lobe_direct.cpp", "core/scattering/lobe_rows.cpp",
             "core/scattering/lobe_shapes-inl.h", "core/scattering/picture_kernels.cpp"],
    r"cblas": ["core/scattering/fields.cpp", "core/scattering/pair_graph.cpp"],
    r"Imf": ["core/surface/io/exr.cpp", "core/table/io/exr.cpp", "core/table/io/image_io.cpp"],
    r"png\.h": ["core/surface/io/png.cpp", "core/table/io/image_io.cpp", "server/service/hillshade.cpp"],
    r"prometheus/": ["server/service/metrics.cpp"],
    r"seccomp": ["server/service/untrusted.cpp"],
    r"cairo": ["clients/plot/"],
    r"openssl/": ["core/base/sha256.cpp"],
    r"Imath/": ["core/base/half.h"],
    r"Random123/": ["core/base/random.h"],
    r"sqlite3": ["server/store/sqlite.cpp"],
    r"CLI/": ["clients/cli/"],
}
# What judges must not include what it judges: the path tracer knows nothing of the fast engine.
JUDGES = {
    "core/scattering/path_tracer": r"visibility/|scattering/(tile|fields|irradiance|kernels|link_operator|diffuse)",
    "core/scattering/embree_scene": r"visibility/|scattering/(tile|fields|irradiance|kernels|link_operator|diffuse)",
    "core/measure/reference": r"visibility/|scattering/(tile|fields|irradiance|kernels|link_operator|diffuse)|measure/(run|estimate|planning)",
}

faults = []
files = 0
for top in TOP:
    for path in sorted((root / top).rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        files += 1
        name = path.relative_to(root).as_posix()
        for line, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', text)
            if not match:
                continue
            include = match.group(2)
            for pattern, homes in HOMES.items():
                if re.match(pattern, include) and not any(name.startswith(home) for home in homes):
                    faults.append(f"{name}:{line}: <{include}> belongs to {', '.join(homes)}")
            for judge, forbidden in JUDGES.items():
                if name.startswith(judge) and re.match(forbidden, include):
                    faults.append(f"{name}:{line}: the judge includes {include}, which it judges")
            if match.group(1) != '"':
                continue
            folder = include.split("/")[0]
            target = "core" if folder in CORE else folder
            if target not in TOP:
                continue
            if target not in TOP[top]:
                faults.append(f"{name}:{line}: {top} may not include {include}")
            if top == "core" and target == "core":
                own = path.relative_to(root / "core").parts[0]
                if own in CORE and CORE.index(folder) > CORE.index(own):
                    faults.append(f"{name}:{line}: core/{own} may not include {include}, which stands to its right")

print("\n".join(faults) or f"{files} files, no include against the order")
sys.exit(1 if faults or files < 50 else 0)
