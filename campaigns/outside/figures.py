from plays import count, is_claim, plays, said


def figures(raw):
    every = plays(raw)
    taken = [play for play in every if is_claim(play) and not play["unexplained"]]
    inside = [play for play in taken if set(play["class"]) & set(play["truth"]["ideal_class"])]
    return {
        "called unexplained": count(every, lambda play: play["said"] == "unexplained"),
        "called none": count(every, lambda play: play["said"] == "none"),
        "taken for an effect that looks unlike it": f"{len(taken) - len(inside)} of {len(every):,}",
    }, said(every)
