from plays import documents, of


def figures(raw):
    cases = [case for document in documents(raw).values() for case in document]
    several = [case for case in cases if case["compared"]]

    def judged(case, how):
        return [pair for pair in case["compared"] if pair["judged"] == how]

    apart = [case for case in several if judged(case, "apart")]
    pairs = [pair for case in several for pair in judged(case, "apart")]
    alike = [pair for case in several for pair in judged(case, "alike")]
    found = {
        "records with several equivalent effects": of(len(several), len(cases)),
        "records that some scenario separates, and for which all such scenarios are named": of(
            sum(all(pair["named"] for pair in judged(case, "apart")) for case in apart), len(apart)
        ),
        "scenarios and effects whose intervals lie apart, named": of(sum(bool(pair["named"]) for pair in pairs), len(pairs)),
        "scenarios and effects whose medians agree, named": of(sum(bool(pair["named"]) for pair in alike), len(alike)),
        "predictions refused": of(sum(bool(case["refused"]) for case in cases), len(cases)),
    }
    return found, {"effects": sorted({effect for case in several for effect in (*case["claimed"], *case["rivals"])})}
