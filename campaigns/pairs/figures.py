from plays import count, in_class, is_claim, plays, said


def figures(raw):
    every = plays(raw)
    named = [play for play in every if in_class(play) and play["heldout_over_true_noise"] is not None]
    return {
        "both in class": count(every, in_class),
        "something claimed": count(every, is_claim),
        "held-out error at most 1.1 × the true noise": count(named, lambda play: play["heldout_over_true_noise"] <= 1.1),
    }, said(every)
