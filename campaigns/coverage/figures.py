from plays import documents, of


def figures(raw):
    intervals = [interval for document in documents(raw).values() for interval in document["intervals"]]
    counted = [interval for interval in intervals if interval["is_covered"] is not None]

    def covered(own):
        return of(sum(interval["is_covered"] for interval in own), len(own))

    effects = sorted({interval["effect"] for interval in counted})
    each = {slug: covered([interval for interval in counted if interval["effect"] == slug]) for slug in effects}
    return {"all": covered(counted)} | each, {"failed": [interval["failure"] for interval in intervals if interval["failure"]]}
