//! The manifests: Kubernetes' own kinds against its schemas, KEDA's by shape, and whatever one file says of another.

use super::{
    drain, file, text,
    tools::{succeeds, tool, yaml},
};
use serde_json::Value;
use std::sync::OnceLock;

const NATIVE: [&str; 5] = ["coordinator", "worker", "networkpolicy", "secret.example", "ingress.example"];

fn path(name: &str) -> String {
    format!("deploy/kubernetes/{name}.yaml")
}

/// Every object of all manifests.
fn objects() -> &'static [Value] {
    static READ: OnceLock<Vec<Value>> = OnceLock::new();
    READ.get_or_init(|| {
        let paths: Vec<String> = NATIVE.into_iter().chain(["scaledobject"]).map(path).collect();
        yaml(&paths.iter().map(String::as_str).collect::<Vec<_>>())
    })
}

/// One of them.
fn object(kind: &str, name: &str) -> &'static Value {
    let found = objects().iter().find(|object| object["kind"] == kind && object["metadata"]["name"] == name);
    found.unwrap_or_else(|| panic!("there is no {kind} `{name}`"))
}

#[test]
fn deploy_manifests_fit_the_schemas_of_kubernetes() {
    let output = succeeds(tool("kubernetes-validate").arg("--strict").args(NATIVE.map(|name| file(&path(name)))));
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    // It only warns of kinds that it does not know.
    assert!(said.contains("passed") && !said.contains("Couldn't find schema"), "{said}");
    assert!(objects().iter().all(|object| object["metadata"]["namespace"].is_null()), "the namespace is the operator's choice");
}

/// What KEDA's definition of a ScaledObject asks for, as far as ours says it.
#[test]
fn deploy_scaled_object_is_one_of_keda_s() {
    let scaled = object("ScaledObject", "kiln-worker");
    assert_eq!(scaled["apiVersion"], "keda.sh/v1alpha1");
    let spec = &scaled["spec"];
    let counts = ["minReplicaCount", "maxReplicaCount", "pollingInterval", "cooldownPeriod"];
    let known = [&counts[..], &["scaleTargetRef", "fallback", "advanced", "triggers"]].concat();
    for key in spec.as_object().unwrap().keys() {
        assert!(known.contains(&key.as_str()), "{key}");
    }
    for count in counts {
        assert!(spec[count].is_u64(), "{count}");
    }
    assert!(spec["fallback"]["failureThreshold"].is_u64() && spec["fallback"]["replicas"].is_u64());
    object("Deployment", spec["scaleTargetRef"]["name"].as_str().unwrap());
    let triggers = spec["triggers"].as_array().unwrap();
    let watched: Vec<&str> = triggers.iter().map(|trigger| trigger["metadata"]["valueLocation"].as_str().unwrap()).collect();
    assert_eq!(watched, ["kiln_tiles_pending", "kiln_tiles_leased"]);
    for trigger in triggers {
        assert_eq!(trigger["type"], "metrics-api");
        let metadata = trigger["metadata"].as_object().unwrap();
        assert!(metadata.values().all(Value::is_string), "KEDA takes strings only: {metadata:?}");
        assert_eq!((&metadata["format"], &metadata["authMode"]), (&"prometheus".into(), &"bearer".into()));
        let url = metadata["url"].as_str().unwrap();
        let (host, path) = url.strip_prefix("http://").unwrap().split_once('/').unwrap();
        let service = object("Service", host.split('.').next().unwrap());
        assert_eq!((host.rsplit_once(':').unwrap().1, path), (service["spec"]["ports"][0]["port"].to_string().as_str(), "metrics"));
        let secrets = &object("TriggerAuthentication", trigger["authenticationRef"]["name"].as_str().unwrap())["spec"]["secretTargetRef"];
        assert_eq!(secrets[0]["parameter"], "token");
        assert_has_key(&secrets[0]);
    }
}

/// That a reference to a key of a Secret finds it in the example.
fn assert_has_key(reference: &Value) {
    let (secret, key) = (reference["name"].as_str().unwrap(), reference["key"].as_str().unwrap());
    assert!(object("Secret", secret)["stringData"][key].is_string(), "the Secret {secret} has no key {key}");
}

#[test]
fn deploy_manifests_agree_with_each_other() {
    let kustomization = &yaml(&["deploy/kubernetes/kustomization.yaml"])[0];
    let resources: Vec<&str> = kustomization["resources"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    for resource in &resources {
        assert!(file(&format!("deploy/kubernetes/{resource}")).exists(), "{resource}");
    }
    assert!(!resources.iter().any(|name| name.contains("example")), "examples are not applied");
    let images: Vec<&Value> = kustomization["images"].as_array().unwrap().iter().map(|image| &image["name"]).collect();
    let generated = &kustomization["configMapGenerator"][0];
    for name in ["kiln-coordinator", "kiln-worker"] {
        let deployment = object("Deployment", name);
        let template = &deployment["spec"]["template"];
        assert_eq!(deployment["spec"]["selector"]["matchLabels"], template["metadata"]["labels"], "{name}");
        object("NetworkPolicy", name);
        let container = &template["spec"]["containers"][0];
        assert!(images.contains(&&container["image"]), "{name}");
        let grace = template["spec"]["terminationGracePeriodSeconds"].as_u64().unwrap();
        assert!(grace > drain(), "{name} is killed after {grace} s");
        is_restricted(&template["spec"], container);
        for variable in container["env"].as_array().into_iter().flatten().filter(|variable| variable["valueFrom"].is_object()) {
            assert_has_key(&variable["valueFrom"]["secretKeyRef"]);
        }
        for volume in template["spec"]["volumes"].as_array().unwrap().iter().filter(|volume| volume["configMap"].is_object()) {
            assert_eq!(volume["configMap"]["name"], generated["name"]);
        }
    }
    assert_eq!(generated["files"][0], "kiln.toml");
    let ingress = object("Ingress", "kiln");
    let backend = &ingress["spec"]["rules"][0]["http"]["paths"][0]["backend"]["service"];
    assert_eq!(object("Service", backend["name"].as_str().unwrap())["spec"]["ports"][0]["name"], backend["port"]["name"]);
    let port = &object("Deployment", "kiln-coordinator")["spec"]["template"]["spec"]["containers"][0]["ports"][0]["containerPort"];
    assert!(text("deploy/kubernetes/kiln.toml").contains(&format!("listen = \"0.0.0.0:{port}\"")));
}

/// What the `restricted` level of Pod Security Standards asks for, and a root file system that nobody writes.
fn is_restricted(pod: &Value, container: &Value) {
    let (of_pod, own) = (&pod["securityContext"], &container["securityContext"]);
    assert_eq!(of_pod["runAsNonRoot"], true);
    assert_eq!(of_pod["seccompProfile"]["type"], "RuntimeDefault");
    assert_eq!((&own["allowPrivilegeEscalation"], &own["readOnlyRootFilesystem"]), (&false.into(), &true.into()));
    assert_eq!(own["capabilities"]["drop"], serde_json::json!(["ALL"]));
    let user = of_pod["runAsUser"].as_u64().unwrap();
    assert!(text("deploy/docker/Dockerfile").contains(&format!("\nUSER {user}:")), "the image's user is another than {user}");
}
