from plays import documents, of


def figures(raw):
    document = documents(raw)["coverage"]
    each = {own["effect"]: of(own["covered"], own["counted"]) for own in document["effects"]}
    covered = sum(own["covered"] for own in document["effects"])
    return {"all": of(covered, document["counted"])} | each, {"failed": [own["failure"] for own in document["intervals"] if own["failure"]]}
