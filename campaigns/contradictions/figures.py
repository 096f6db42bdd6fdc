"""What was found in records that contradict their description, and in those that do not."""

import json


def figures(raw):
    document = json.loads((raw / "counted.txt").read_text(encoding="utf-8"))
    records, found = document["records"], document["found"]
    told = {
        "found": f"{min(found.values())} of {records} of the kind that is found least",
        "false": f"{document['sound_called']} of {document['sound_records']} sound records are called anything",
    }
    return told, {"found": found, "sound_called_as": document["sound_called_as"]}
