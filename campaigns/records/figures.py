from plays import documents

UNITS = {"um": "µm", "percent": "%", "pa": "Pa"}


def words(record):
    if "refused" in record:
        return record["refused"]
    unit = UNITS[record["unit"]]
    baseline = record["baselines"][record["best_baseline"]]
    verdict = "explained" if record["is_explained"] else "unexplained"
    return (
        f"{record['law']} {record['error']:.3g} {unit}, {record['best_baseline']} {baseline:.3g} {unit}, ratio {record['error'] / baseline:.2f}, "
        f"{record['error'] / record['noise']:.3g} times the noise, {verdict}"
    )


def figures(raw):
    records = documents(raw)["records"]
    compared = [record for record in records if "refused" not in record]
    near = sum(record["error"] <= 1.1 * record["baselines"][record["best_baseline"]] for record in compared)
    found = {record["record"]: words(record) for record in records}
    found["records where the closest law is at most 1.1 times the best closed form"] = f"{near} of {len(records)}"
    return found, {"records": len(records)}
