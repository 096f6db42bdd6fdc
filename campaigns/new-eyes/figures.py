from plays import documents, of


def figures(raw):
    eyes = [eye for document in documents(raw).values() for case in document for eye in case["inside"]]
    found = {
        f"new eyes inside the 90 % band at {time_s} s": of(sum(eye[place] for eye in eyes), len(eyes))
        for place, time_s in enumerate((4, 8))
    }
    return found, {"new_eyes": len(eyes)}
