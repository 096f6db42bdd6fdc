from plays import count, effects, in_class, is_claim, mean, plays, said


def figures(raw):
    every = plays(raw)
    weak = [play for play in every if play["truth"]["signal_sigma"] and round(play["truth"]["signal_sigma"]) <= 5]
    named = [play for play in every if in_class(play) and play["heldout_over_true_noise"] is not None]
    sized = [play for play in every if play["size_covered"] is not None]
    claims = [play for play in every if is_claim(play)]
    return {
        "in class": count(every, in_class),
        "in class at 5 σ": count(weak, in_class),
        "in class at 10 σ and more": count([play for play in every if play not in weak], in_class),
        "size of the class": mean(len(play["class"]) for play in claims),
        "size by definition": mean(len(play["truth"]["ideal_class"]) for play in claims),
        "held-out error at most 1.1 × the true noise": count(named, lambda play: play["heldout_over_true_noise"] <= 1.1),
        "size inside its 90 % interval": count(sized, lambda play: play["size_covered"]),
    }, said(every) | {"effects": sorted({slug for play in every for slug in effects(play)})}
