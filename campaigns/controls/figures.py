from plays import count, plays, plays_by_label, said


def figures(raw):
    each = plays_by_label(raw)
    wrong = {f"{noise}: anything but none": count(own, lambda play: play["said"] != "none") for noise, own in each.items()}
    every = plays(raw)
    all_of_them = {
        "all: an effect is claimed": count(every, lambda play: play["said"] not in ("none", "unexplained")),
        "all: called unexplained": count(every, lambda play: play["said"] == "unexplained"),
    }
    return wrong | all_of_them, {noise: said(own) for noise, own in each.items()}
