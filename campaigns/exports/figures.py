import json


def figures(raw):
    files = json.loads((raw / "exports.json").read_text(encoding="utf-8"))
    readable = [file for file in files if file["expected"] == "read"]
    others = [file for file in files if file["expected"] == "refused"]
    count = lambda some, outcome: sum(file["outcome"] == outcome for file in some)
    found = {
        "exports read": f"{count(readable, 'read')} of {len(readable)}",
        "exports refused with a remedy": f"{count(readable, 'refused')} of {len(readable)}",
        "other files refused by name": f"{count(others, 'refused')} of {len(others)}",
        "files read with other numbers": f"{count(files, 'wrong')} of {len(files)}",
    }
    return found, {"files": files}
