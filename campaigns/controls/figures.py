from plays import count, documents, plays, said


def figures(raw):
    each = documents(raw)
    wrong = {
        f"{noise}: anything but none": count(document["plays"], lambda play: play["said"] != "none")
        for noise, document in each.items()
    }
    every = plays(raw)
    all_of_them = {
        "all: an effect is claimed": count(every, lambda play: play["said"] not in ("none", "unexplained")),
        "all: called unexplained": count(every, lambda play: play["said"] == "unexplained"),
    }
    return wrong | all_of_them, {noise: said(document["plays"]) for noise, document in each.items()}
